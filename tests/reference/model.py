"""A complete model with every part, small enough for its gradients to fit into a file."""

import torch

import fields
import motion
import render
import skeleton
from fields import single

JOINTS = len(skeleton.SMALL_PARENTS)
POSE = 3 * (JOINTS - 1)
SLOTS = 2
CODE = 8
RESOLUTION = 10
CORRECTION = dict(width=12, depth=2)
CONDITION_BANDS = 3
NON_RIGID = dict(bands=3, width=16, depth=4, skip=2, inject=1, kick_in=0, full_at=100)
CANONICAL = dict(width=16, depth=4, skip=2, inject=2, density_scale=8.0)
FOURIER_BANDS = 4
HASH = dict(levels=3, base=4, growth=1.6, log2_rows=7, features=2)
SAMPLES = 12
LESS_BACKGROUND = 9.0
SSIM_WEIGHT = 0.1
# Learning rates by prefix of a parameter's name; the first match counts.
RATES = [
    ("canonical.tables", 1e-2),
    ("motion.", 4e-3),
    ("correction.", 5e-4),
    ("condition.", 5e-4),
    ("non_rigid.", 5e-4),
    ("", 2e-3),
]


class Body:
    """The small tree with its canonical box and prior."""

    def __init__(self):
        self.parents = skeleton.SMALL_PARENTS
        self.rest = torch.tensor(skeleton.SMALL_REST, dtype=torch.float64)
        self.low, self.high = motion.canonical_box(self.rest)
        self.prior = motion.prior(
            self.parents, skeleton.SMALL_TORSO, skeleton.SMALL_HEAD, self.rest, RESOLUTION
        ).reshape(JOINTS + 1, -1)

    def hash_grid(self):
        """The grid over the canonical box."""
        return fields.HashGrid(**HASH, low=self.low, side=(self.high - self.low).max())


class Model:
    """Parameters and forward pass; `encoding` is "fourier" or "hash"."""

    def __init__(self, encoding, body, generator):
        def draw(*shape):
            return torch.randn(*shape, dtype=torch.float64, generator=generator)

        def leaf(*shape, scale=1.0):
            return single(draw(*shape) * scale).requires_grad_()

        self.encoding, self.body, self.grid = encoding, body, body.hash_grid()
        self.codes = [leaf(CODE, scale=0.5) for _ in range(SLOTS)]
        voxels = (JOINTS + 1, RESOLUTION**3)
        # Less background than the prior has: the box is coarse, and rays should see something.
        less = torch.zeros(JOINTS + 1, 1, dtype=torch.float64)
        less[-1] = -LESS_BACKGROUND
        self.base = single(draw(*voxels) * 0.5 + less).requires_grad_()
        self.residuals = [leaf(*voxels, scale=0.5) for _ in range(SLOTS)]
        self.condition = {"joints": leaf(6 * CONDITION_BANDS, CODE, scale=0.3)}
        for name in ("query", "key", "value"):
            self.condition[name] = leaf(CODE, CODE, scale=0.3)
        width, depth = CORRECTION["width"], CORRECTION["depth"]
        layers = [([("weight", POSE if layer == 0 else width)], width) for layer in range(depth)]
        self.correction = fields.Network("correction.mlp", layers, POSE, draw, output_scale=0.1)
        self.non_rigid = self.deep("non_rigid.mlp", NON_RIGID, 6 * NON_RIGID["bands"], 3, draw, 0.1, first_code=POSE)
        if encoding == "hash":
            width, self.tables = self.grid.features * HASH["levels"], [
                leaf(self.grid.rows, HASH["features"], scale=0.7) for _ in range(SLOTS)
            ]
        else:
            width, self.tables = 3 + 6 * FOURIER_BANDS, []
        self.canonical = self.deep("canonical.mlp", CANONICAL, width, 4, draw, 1.0, skip_first=True)

    @staticmethod
    def deep(path, sizes, width, output, draw, output_scale, first_code=0, skip_first=False):
        """A network with a skip and a code. HumanNeRF joins (h, x) in the non-rigid network and
        (x, h) in the canonical one; a code comes after, the pose vector before."""
        layers = []
        for layer in range(sizes["depth"]):
            parts = [("weight", width if layer == 0 else sizes["width"])]
            if layer == 0 and first_code:
                parts.insert(0, ("code", first_code))
            if layer == sizes["skip"]:
                parts.insert(0 if skip_first else 1, ("skip", width))
            if layer == sizes["inject"]:
                parts.append(("code", CODE))
            layers.append((parts, sizes["width"]))
        return fields.Network(path, layers, output, draw, output_scale)

    def named(self, of=lambda leaf: leaf.detach()):
        """This project's name of each parameter, with `of` it."""
        names = {f"codes.{slot}": of(code) for slot, code in enumerate(self.codes)}
        names["motion.base"] = of(self.base)
        names |= {f"motion.residuals.{slot}": of(r) for slot, r in enumerate(self.residuals)}
        names |= {f"condition.{name}": of(matrix) for name, matrix in self.condition.items()}
        names |= {f"canonical.tables.{slot}": of(table) for slot, table in enumerate(self.tables)}
        for network in (self.correction, self.non_rigid, self.canonical):
            names |= network.named(of)
        return names

    def leaves(self):
        """All parameters."""
        return [
            *self.codes, self.base, *self.residuals, *self.condition.values(), *self.tables,
            *self.correction.leaves(), *self.non_rigid.leaves(), *self.canonical.leaves(),
        ]

    def clear(self):
        """Clears gradients."""
        for leaf in self.leaves():
            leaf.grad = None

    def volume(self, slot):
        """[K + 1, D^3]."""
        return motion.weight_volume(self.base, self.residuals[slot], self.body.prior)

    def correct(self, vector):
        """Pose vector -> [K - 1, 3, 3]."""
        return skeleton.rotation(self.correction.forward(vector[None], {}).reshape(-1, 3))

    def relative_joints(self, pose):
        """[K - 1, 3] relative to the root, of the pose as given."""
        body = self.body
        joints = skeleton.joint_positions(body.parents, body.rest, skeleton.body_rotations(pose))
        return joints[1:] - joints[0]

    def conditioned(self, slot, pose):
        """F_nr."""
        return fields.pose_condition(
            self.condition, self.codes[slot], self.relative_joints(pose), CONDITION_BANDS
        )

    def move(self, points, vector, code, step):
        """Canonical points after non-rigid motion."""
        bands, start = NON_RIGID["bands"], NON_RIGID["kick_in"]
        a = bands * max(step - start, 0) / (NON_RIGID["full_at"] - start)
        encoded = fields.frequencies(points, bands, window=fields.hann_window(bands, a))
        return points + self.non_rigid.forward(encoded, {0: vector, NON_RIGID["inject"]: code})

    def field(self, points, slot, code):
        """rgb [N, 3] and density [N]."""
        if self.encoding == "hash":
            encoded = self.grid.encode(self.tables[slot], points)
        else:
            encoded = torch.cat([points, fields.frequencies(points, FOURIER_BANDS)], -1)
        raw = self.canonical.forward(encoded, {CANONICAL["inject"]: code})
        return torch.sigmoid(raw[:, :3]), fields.density(raw[:, 3], CANONICAL["density_scale"])

    def see(self, slot, pose, step, origin, directions):
        """Colour over black, opacity and depth of rays in the body frame."""
        body, vector = self.body, pose[1:].reshape(-1)
        rotations = skeleton.body_rotations(pose, self.correct(vector))
        transforms = skeleton.bone_transforms(body.parents, body.rest, rotations)
        # The box is that of the pose as given: it only bounds the search.
        joints = self.relative_joints(pose) + body.rest[0]
        near, far, met = render.slabs(origin, directions, torch.cat([body.rest[:1], joints]))
        middle = (torch.arange(SAMPLES, dtype=pose.dtype) + 0.5) / SAMPLES
        depths = near[:, None] + (far - near)[:, None] * middle
        ends = torch.cat([depths[:, 1:], far[:, None]], 1)
        steps = (ends - depths) * directions.norm(dim=-1, keepdim=True)
        points = (origin + depths[..., None] * directions[:, None]).reshape(-1, 3)
        volume = self.volume(slot).reshape(JOINTS + 1, RESOLUTION, RESOLUTION, RESOLUTION)[:JOINTS]
        canonical, likelihood = motion.warp(volume, transforms, points, body.low, body.high)
        moved = self.move(canonical, vector, self.conditioned(slot, pose), step)
        rgb, density = self.field(moved, slot, self.codes[slot])
        shape = depths.shape
        colour, alpha, depth = render.composite(
            rgb.reshape(*shape, 3), density.reshape(shape), likelihood.reshape(shape), steps, depths
        )
        hit = met.to(colour.dtype)
        return colour * hit[:, None], alpha * hit, depth * hit
