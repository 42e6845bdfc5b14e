"""Writes the parity cases: inputs, expected values and gradients, all in double precision.

    python tests/reference/make_cases.py [FOLDER]

A case is a safetensors file. Inputs have plain names; `expected.X` is output X, `towards.X` what
its gradient comes from (the objective is the sum of all X * towards.X), `gradient.Y` the gradient to
input or parameter Y. `model-*.safetensors` hold whole models under the names of checkpoints.
"""

import sys
from pathlib import Path

import torch
from safetensors.torch import save_file

import fields
import model as tiny
import motion
import render
import skeleton
from fields import single

FOLDER = Path(__file__).resolve().parents[2] / "worker" / "avatar" / "tests" / "cases"
# Larger results are stored in single precision: this halves their size and rounds by 6e-8, far
# under every bound.
KEPT_DOUBLE = 1000
STEP = 60


def generator(name):
    """Numbers that depend only on the case's name."""
    return torch.Generator().manual_seed(sum(ord(c) * 31**i for i, c in enumerate(name)) % 2**31)


class Case:
    """Collects a case's tensors."""

    def __init__(self, name):
        self.name, self.tensors, self.metadata = name, {}, None
        self.generator = generator(name)

    def normal(self, *shape, scale=1.0):
        return single(torch.randn(*shape, dtype=torch.float64, generator=self.generator) * scale)

    def uniform(self, low, high, *shape):
        numbers = torch.rand(*shape, dtype=torch.float64, generator=self.generator)
        return single(low + (high - low) * numbers)

    def give(self, **inputs):
        for name, value in inputs.items():
            value = value.detach()
            exact = value.dtype != torch.float64 or bool((single(value) == value).all())
            self.tensors[name] = value.float() if exact and value.is_floating_point() else value

    def result(self, name, value):
        value = value.detach().contiguous()
        self.tensors[name] = value.float() if value.numel() > KEPT_DOUBLE else value

    def check(self, outputs, leaves=(), inputs=None):
        """Records outputs, and gradients to `inputs` and, through `leaves()`, to parameters."""
        objective = 0.0
        for name, value in outputs.items():
            self.result(f"expected.{name}", value)
            if value.requires_grad:
                towards = self.normal(*value.shape)
                self.give(**{f"towards.{name}": towards})
                objective = objective + (value * towards).sum()
        if isinstance(objective, torch.Tensor):
            objective.backward()
        for name, leaf in (inputs or {}).items():
            self.result(f"gradient.{name}", leaf.grad)
        for name, grad in leaves() if callable(leaves) else ():
            self.result(f"gradient.{name}", grad)

    def skeleton(self, names, parents, rest):
        self.give(parents=torch.tensor(parents), rest=torch.tensor(rest, dtype=torch.float64))
        self.metadata = {"names": ",".join(names)}

    def save(self):
        tensors = {name: tensor.contiguous().clone() for name, tensor in sorted(self.tensors.items())}
        save_file(tensors, FOLDER / f"{self.name}.safetensors", metadata=self.metadata)


def small(case):
    case.skeleton(skeleton.SMALL_NAMES, skeleton.SMALL_PARENTS, skeleton.SMALL_REST)


def smpl(case):
    case.skeleton(skeleton.SMPL_NAMES, skeleton.SMPL_PARENTS, skeleton.SMPL_REST)
    return torch.tensor(skeleton.SMPL_REST, dtype=torch.float64)


def gradients_of(model, *starts):
    """Gradients of the parameters with this prefix; unused parameters have none."""
    found = model.named(lambda leaf: torch.zeros_like(leaf) if leaf.grad is None else leaf.grad)
    return [(name, grad) for name, grad in found.items() if name.startswith(starts)]


def prior():
    case = Case("prior")
    rest = smpl(case)
    volume = motion.prior(skeleton.SMPL_PARENTS, skeleton.SMPL_TORSO, skeleton.SMPL_HEAD, rest, 13)
    case.check({"prior": volume.reshape(len(rest) + 1, -1)})
    case.save()


def rodrigues():
    case = Case("rodrigues")
    angles = [0.0, 1e-8, 1e-5, 0.999e-3, 1.001e-3, 0.1, 1.0, torch.pi, 2 * torch.pi, 10.0]
    axes = case.normal(3, 3)
    axes = torch.cat([axes / axes.norm(dim=1, keepdim=True), torch.eye(3, dtype=torch.float64)])
    r = single(torch.cat([angle * axes for angle in angles])).requires_grad_()
    case.give(r=r)
    case.check({"rotation": skeleton.rotation(r)}, inputs={"r": r})
    case.save()


def kinematics():
    case = Case("kinematics")
    rest, parents = smpl(case), skeleton.SMPL_PARENTS
    pose = case.normal(len(parents), 3, scale=0.5)
    vectors = case.normal(len(parents) - 1, 3, scale=0.2).requires_grad_()
    case.give(pose=pose, vectors=vectors)
    plain = skeleton.body_rotations(pose)
    joints = skeleton.joint_positions(parents, rest, plain)
    rotations = skeleton.body_rotations(pose, skeleton.rotation(vectors))
    corrected = skeleton.bone_transforms(parents, rest, rotations)
    outputs = {
        "transforms": skeleton.bone_transforms(parents, rest, plain).reshape(-1, 12),
        "joints": joints[1:] - joints[0],
        "corrected": corrected.reshape(-1, 12),
    }
    case.check(outputs, inputs={"vectors": vectors})
    case.save()


def decoder():
    """The weight volume of the deconvolution form; its few weights are in a file like a model's."""
    case = Case("volume-deconv")
    small(case)
    rest = torch.tensor(skeleton.SMALL_REST, dtype=torch.float64)
    widths, channels = [4, 8, 6, 5, tiny.JOINTS + 1], range(3)
    leaves = {
        "embeddings.0": case.normal(widths[0]),
        "embeddings.1": case.normal(widths[0]),
        "linear": case.normal(widths[0], widths[1]),
        "bias": case.normal(widths[1], scale=0.1),
    }
    for layer in channels:
        leaves[f"kernels.{layer}"] = case.normal(widths[layer + 1], widths[layer + 2], 4, 4, 4, scale=0.15)
        leaves[f"biases.{layer}"] = case.normal(widths[layer + 2], scale=0.1)
    for leaf in leaves.values():
        leaf.requires_grad_()
    logits = motion.decode(
        leaves["embeddings.1"], leaves["linear"], leaves["bias"],
        [leaves[f"kernels.{layer}"] for layer in channels], [leaves[f"biases.{layer}"] for layer in channels],
    )
    volume = motion.prior(skeleton.SMALL_PARENTS, skeleton.SMALL_TORSO, skeleton.SMALL_HEAD, rest, 8)
    volume = motion.weight_volume(logits, 0.0, volume.reshape(tiny.JOINTS + 1, -1))
    path = "motion.decoder."
    case.check(
        {"volume": volume},
        lambda: [(path + name, torch.zeros_like(x) if x.grad is None else x.grad) for name, x in leaves.items()],
    )
    case.save()
    save_file({path + name: leaf.detach().float() for name, leaf in leaves.items()}, FOLDER / "model-deconv.safetensors")


def warp():
    case = Case("warp")
    bones, d, n = 5, 7, 300
    low, high = single(torch.tensor([-1.0, -0.5, -0.8]).double()), single(torch.tensor([1.0, 1.5, 0.6]).double())
    # The last channel is the background, which points never read.
    weights = case.uniform(0.0, 0.45, bones + 1, d**3).requires_grad_()
    transforms = case.uniform(-0.8, 0.8, bones, 12).requires_grad_()
    points = case.uniform(-1.6, 1.6, n, 3)
    case.give(weights=weights, transforms=transforms, points=points, low=low, high=high)
    canonical, likelihood = motion.warp(
        weights.reshape(-1, d, d, d)[:bones], transforms.reshape(-1, 3, 4), points, low, high
    )
    assert (likelihood == 1).any() and (likelihood == 0).any(), "both ends of the clamp"
    case.check(
        {"canonical": canonical, "likelihood": likelihood}, inputs={"weights": weights, "transforms": transforms}
    )
    case.save()


def encodings():
    case = Case("encodings")
    points = case.normal(40, 3, scale=0.7).requires_grad_()
    case.give(points=points, openness=torch.tensor([0.0, 0.4, 1.8, 3.5, 6.0], dtype=torch.float64))
    window = fields.hann_window(6, 3.5)
    outputs = {
        "plain": fields.frequencies(points, 10),
        "pi": fields.frequencies(points, 6, torch.pi),
        "windowed": fields.frequencies(points, 6, window=window),
        "window": torch.tensor([fields.hann_window(6, float(a)) for a in case.tensors["openness"]]).double(),
    }
    case.check(outputs, inputs={"points": points})
    case.save()


def hash_grid():
    case = Case("hash")
    low = single(torch.tensor([-1.0, -0.5, 0.0]).double())
    grid = fields.HashGrid(4, 3, 1.9, 7, 2, low, 2.0)
    dense = [level[3] for level in grid.levels]
    assert any(dense) and not all(dense), "both kinds of level"
    table = case.normal(grid.rows, 2).requires_grad_()
    points = case.uniform(-1.2, 2.2, 200, 3).requires_grad_()
    case.give(table=table, points=points, low=low)
    case.check({"encoded": grid.encode(table, points)}, inputs={"table": table, "points": points})
    case.save()


def composite():
    case = Case("composite")
    rays, per_ray = 9, 8
    # Ray 0 hits nothing; ray 1 one sample. Ray 2 has an opaque sample in the middle, ray 3
    # three in a row, ray 4 one that is first, ray 5 a likelihood of exactly 0.
    live = case.uniform(0.0, 1.0, rays, per_ray) > 0.3
    live[0], live[1], live[2:6] = False, torch.arange(per_ray) == 3, True
    places = live.flatten().nonzero()[:, 0]
    n = len(places)
    dense_density = case.uniform(0.5, 20.0, rays, per_ray)
    dense_likelihood = case.uniform(0.05, 0.95, rays, per_ray)
    for ray, samples, density in [(2, [4], 1e4), (3, [2, 3, 4], 1e6), (4, [0], 1e10)]:
        dense_density[ray, samples], dense_likelihood[ray, samples] = density, 1.0
    dense_likelihood[5, 2] = 0.0
    leaves = {
        "rgb": case.uniform(0.0, 1.0, n, 3),
        "density": single(dense_density).flatten()[places],
        "likelihood": single(dense_likelihood).flatten()[places],
    }
    for leaf in leaves.values():
        leaf.requires_grad_()
    steps, depths = case.uniform(0.02, 0.15, n), case.uniform(1.0, 3.0, n)
    case.give(**leaves, steps=steps, depths=depths, places=places)

    def dense(values):
        empty = torch.zeros(rays * per_ray, *values.shape[1:], dtype=torch.float64)
        return empty.index_put((places,), values).reshape(rays, per_ray, *values.shape[1:])

    colour, alpha, depth = render.composite(*(dense(v) for v in [*leaves.values(), steps, depths]))
    case.check({"rgb": colour, "alpha": alpha, "depth": depth}, inputs=leaves)
    case.save()


def objective():
    case = Case("objective")
    patches, size = 3, 12
    predicted = case.uniform(0.0, 1.0, patches, size**2, 3).requires_grad_()
    truth = single((0.7 * predicted.detach() + 0.3 * case.uniform(0.0, 1.0, patches, size**2, 3)))
    case.give(predicted=predicted, truth=truth)
    loss = render.objective(predicted, truth, size, tiny.SSIM_WEIGHT)
    loss.backward()
    case.result("expected.loss", loss[None])
    case.result("gradient.predicted", predicted.grad)
    case.save()


def adam():
    case = Case("adam")
    parameter = case.normal(50).requires_grad_()
    gradients = case.normal(3, 50, scale=0.1)
    case.give(parameter=parameter, gradients=gradients)
    optimiser = torch.optim.Adam([parameter], lr=1e-2, betas=(0.9, 0.999), eps=1e-8)
    for gradient in gradients:
        parameter.grad = gradient
        optimiser.step()
    case.result("expected.parameter", parameter)
    case.save()


def parts(model):
    """The parts of the Fourier model, one case each."""
    body, pose_of = model.body, lambda case: case.normal(tiny.JOINTS, 3, scale=0.4)

    case = Case("volume")
    small(case)
    case.result("expected.log_prior", body.prior.clamp_min(motion.LEAST_PRIOR).log())
    model.clear()
    case.check({"volume": model.volume(1)}, lambda: gradients_of(model, "motion."))
    case.save()

    case = Case("correction")
    vector = pose_of(case)[1:].reshape(-1)
    case.give(vector=vector)
    model.clear()
    case.check({"correction": model.correct(vector)}, lambda: gradients_of(model, "correction."))
    case.save()

    case = Case("condition")
    small(case)
    pose = pose_of(case)
    case.give(pose=pose)
    model.clear()
    case.check({"code": model.conditioned(0, pose)}, lambda: gradients_of(model, "condition.", "codes.0"))
    case.save()

    case = Case("non-rigid")
    points = case.normal(64, 3, scale=0.6).requires_grad_()
    vector, code = case.normal(tiny.POSE, scale=0.5), case.normal(tiny.CODE).requires_grad_()
    case.give(points=points, vector=vector, code=code)
    model.clear()
    case.check(
        {"moved": model.move(points, vector, code, STEP)},
        lambda: gradients_of(model, "non_rigid."),
        {"points": points, "code": code},
    )
    case.save()


def canonical(model, name):
    case = Case(name)
    small(case)
    box = model.body.high - model.body.low
    points = single(model.body.low + box * case.uniform(0.02, 0.98, 64, 3)).requires_grad_()
    code = case.normal(tiny.CODE).requires_grad_()
    case.give(points=points, code=code)
    model.clear()
    rgb, density = model.field(points, 1, code)
    case.check(
        {"rgb": rgb, "density": density},
        lambda: gradients_of(model, "canonical."),
        {"points": points, "code": code},
    )
    case.save()


def training_step(model, name):
    """One step: rays of two patches, the loss, every gradient, and all parameters after Adam."""
    case = Case(name)
    small(case)
    size, width = 8, 48
    pose = case.normal(tiny.JOINTS, 3, scale=0.3)
    translation = case.normal(3, scale=0.2)
    # Some way in front of the body and a little turned, looking along +z.
    turn = skeleton.rotation(torch.tensor([0.1, -0.2, 0.15], dtype=torch.float64))
    extrinsics = skeleton.rigid(turn, torch.tensor([0.05, -0.85, 2.6], dtype=torch.float64))
    intrinsics = torch.tensor([[60.0, 0.0, 24.0], [0.0, 62.0, 23.0], [0.0, 0.0, 1.0]], dtype=torch.float64)
    root = skeleton.rotation(pose[0])
    to_world = skeleton.rigid(root, model.body.rest[0] + translation - root @ model.body.rest[0])
    # One patch on the body, one whose rays partly miss the box.
    corners = [(20, 18), (28, 2)]
    pixels = torch.tensor([[x0 + i % size, y0 + i // size] for x0, y0 in corners for i in range(size**2)]) + 0.5
    origin, directions = render.body_rays(intrinsics, extrinsics, to_world, pixels.double())
    truth = case.uniform(0.0, 1.0, len(corners), size**2, 3)
    background = case.uniform(0.0, 1.0, 3)
    case.give(
        pose=pose, translation=translation, extrinsics=extrinsics, intrinsics=intrinsics,
        pixels=pixels.double(), truth=truth, background=background, width=torch.tensor([width]),
    )
    model.clear()
    colour, alpha, depth = model.see(0, pose, STEP, origin, directions)
    predicted = (colour + (1 - alpha)[:, None] * background).reshape(truth.shape)
    loss = render.objective(predicted, truth, size, tiny.SSIM_WEIGHT)
    loss.backward()
    print(f"{name}: loss {loss.item():.6f}, opacity {alpha.mean():.3f}, rays that see {(alpha > 0).double().mean():.3f}")
    case.result("expected.loss", loss[None])
    for output, value in [("rgb", colour), ("alpha", alpha), ("depth", depth)]:
        case.result(f"expected.{output}", value)
    for path, grad in gradients_of(model, ""):
        case.result(f"gradient.{path}", grad)
    before = model.named(lambda leaf: leaf.detach().clone())
    # Gradients are split by name like the parameters, each with its group's rate.
    for path, grad in gradients_of(model, ""):
        parameter = before[path].requires_grad_()
        parameter.grad = grad
        rate = next(rate for start, rate in tiny.RATES if path.startswith(start))
        torch.optim.Adam([parameter], lr=rate, betas=(0.9, 0.999), eps=1e-8).step()
        case.result(f"after.{path}", parameter)
    case.save()


def main():
    global FOLDER
    if len(sys.argv) > 1:
        FOLDER = Path(sys.argv[1])
    FOLDER.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)
    for make in (prior, rodrigues, kinematics, decoder, warp, encodings, hash_grid, composite, objective, adam):
        make()
    body = tiny.Body()
    for encoding in ("fourier", "hash"):
        model = tiny.Model(encoding, body, generator(encoding))
        file = FOLDER / f"model-{encoding}.safetensors"
        save_file({name: value.float().contiguous() for name, value in model.named().items()}, file)
        if encoding == "fourier":
            parts(model)
        canonical(model, f"canonical-{encoding}")
        training_step(model, f"step-{encoding}")


if __name__ == "__main__":
    main()
