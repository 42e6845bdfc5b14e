"""A HumanNeRF checkpoint with random weights, and the released program's render of it.

    python3 tests/reference/humannerf_case.py OUT [--small] [--size 64] [--seed 1]

writes to OUT: checkpoint.tar (as torch.save writes it), canonical_joints.pkl, poses.json (a
capture without pictures, whose rest joints are the canonical ones) and expected.safetensors
(rgb, alpha, depth of two cameras). The
tests of `worker/avatar/tests/humannerf` compare with it: the small case is committed, a
full one is made on demand (YOTO_HUMANNERF_CASE=OUT).

Everything is computed in float64 with numpy, from the description of the program's conventions
and without any code in common with this project or with that program. torch is used for
writing the checkpoint where it is installed; without it the same archive is written by hand.
"""

import argparse
import io
import json
import pickle
import struct
import sys
import types
import zipfile
from collections import OrderedDict
from pathlib import Path

import numpy as np

PARENTS = [-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21]
NAMES = (
    "pelvis l_hip r_hip spine1 l_knee r_knee spine2 l_ankle r_ankle spine3 l_foot r_foot neck "
    "l_collar r_collar head l_shoulder r_shoulder l_elbow r_elbow l_wrist r_wrist l_hand r_hand"
).split()
TORSO = {0, 3, 6, 9, 13, 14}
HEAD = 15
GRID = 32
SAMPLES = 128
BANDS_NON_RIGID, BANDS_CANONICAL = 6, 10
# The released program evaluates at this iteration, regardless of the checkpoint's.
ITERATION = 10_000_000
KICK_IN, FULL = 10_000, 50_000
# SMPL's template has its pelvis here, metres, and the program leaves it there.
PELVIS = (-0.002, -0.223, 0.028)

FULL_WIDTHS = dict(embedding=256, hidden=1024, channels=[512, 512, 256, 256],
                   non_rigid=128, canonical=256, pose=256)
SMALL_WIDTHS = dict(embedding=16, hidden=16, channels=[8, 8, 8, 4],
                    non_rigid=16, canonical=24, pose=16)


# ---------------------------------------------------------------- the body


def rest_joints():
    """A person with stretched arms, metres, y up."""
    half = {
        0: (0, 0, 0), 1: (.07, -.08, .01), 3: (0, .1, -.02), 4: (.1, -.47, .01), 6: (0, .24, 0),
        7: (.09, -.88, -.03), 9: (0, .3, .03), 10: (.12, -.93, .09), 12: (0, .51, -.02),
        13: (.08, .42, -.01), 15: (0, .6, .03), 16: (.19, .44, -.02), 18: (.45, .43, -.04),
        20: (.7, .44, -.05), 22: (.79, .43, -.06),
    }
    joints = np.zeros((24, 3))
    for joint in range(24):
        mirrored = NAMES[joint].startswith("r_")
        source = NAMES.index("l_" + NAMES[joint][2:]) if mirrored else joint
        joints[joint] = half[source]
        if mirrored:
            joints[joint, 0] *= -1
    return np.float32(joints + PELVIS).astype(np.float64)


def skew(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def about(axis, angle):
    return (np.cos(angle) * np.eye(3) + np.sin(angle) * skew(axis)
            + (1 - np.cos(angle)) * np.outer(axis, axis))


def rotation(v):
    """Of poses: the axis is divided by |v| + 1e-5."""
    angle = np.linalg.norm(v)
    return about(v / (angle + 1e-5), angle)


def rigid(r, t):
    m = np.eye(4)
    m[:3, :3], m[:3, 3] = r, t
    return m


def exact_rotation(v):
    angle = np.linalg.norm(v)
    return np.eye(3) if angle == 0 else about(v / angle, angle)


def chain(rotations, joints):
    transforms = []
    for joint, parent in enumerate(PARENTS):
        offset = joints[joint] - (joints[parent] if parent >= 0 else 0)
        local = rigid(rotations[joint], offset)
        transforms.append(local if parent < 0 else transforms[parent] @ local)
    return np.array(transforms)


# ---------------------------------------------------------------- motion weights


def box(joints):
    return joints.min(0) - 0.3, joints.max(0) + 0.3


def bone_frame(direction):
    """A rotation that takes +y to a direction."""
    y = direction / np.linalg.norm(direction)
    x = np.cross(y, [0.0, 0.0, 1.0])
    if np.linalg.norm(x) < 1e-6:
        x = np.cross(y, [1.0, 0.0, 0.0])
    x /= np.linalg.norm(x)
    return np.stack([x, y, np.cross(x, y)], 1)


def prior_volume(joints):
    low, high = box(joints)
    axes = [np.linspace(low[a], high[a], GRID) for a in range(3)]
    z, y, x = np.meshgrid(axes[2], axes[1], axes[0], indexing="ij")
    points = np.stack([x, y, z], -1)
    volume = np.zeros((25, GRID, GRID, GRID))

    def blob(middle, frame, scale):
        sigma = frame @ np.diag(scale) @ np.diag(scale) @ frame.T
        offset = points - middle
        return np.exp(-np.einsum("...i,ij,...j->...", offset, sigma, offset))

    for joint in range(24):
        children = [c for c in range(24) if PARENTS[c] == joint]
        for child in children:
            scale = 1 / (2 * np.array([0.03, 0.06, 0.03]))
            if joint in TORSO:
                scale[[0, 2]] /= 1.5
            bone = joints[child] - joints[joint]
            middle = (joints[child] + joints[joint]) / 2
            volume[joint] += blob(middle, bone_frame(bone), scale)
        if not children:
            deviation = 0.06 if joint == HEAD else 0.02
            volume[joint] = blob(joints[joint], np.eye(3), np.full(3, 1 / (2 * deviation)))
    volume[24] = 1 - np.clip(volume[:24].sum(0), 0, 1)
    return np.float32(volume / np.clip(volume.sum(0), 0.001, None)).astype(np.float64)


def conv_transpose(x, weight, bias):
    """Kernel 4, stride 2, padding 1."""
    _, d, h, w = x.shape
    out = np.zeros((weight.shape[1], 2 * d + 2, 2 * h + 2, 2 * w + 2))
    for a in range(4):
        for b in range(4):
            for c in range(4):
                product = np.tensordot(weight[:, :, a, b, c], x, (0, 0))
                out[:, a:a + 2 * d:2, b:b + 2 * h:2, c:c + 2 * w:2] += product
    return out[:, 1:-1, 1:-1, 1:-1] + bias[:, None, None, None]


def leaky(x):
    return np.where(x > 0, x, 0.2 * x)


def weight_volume(net, prior):
    decoder = "mweight_vol_decoder.decoder."
    hidden = (net[decoder + "block_mlp.0.weight"] @ net["mweight_vol_decoder.const_embedding"]
              + net[decoder + "block_mlp.0.bias"])
    x = leaky(hidden)[:, None, None, None]
    for layer in range(5):
        name = f"{decoder}block_conv.{2 * layer}."
        x = conv_transpose(x, net[name + "weight"], net[name + "bias"])
        if layer < 4:
            x = leaky(x)
    with np.errstate(divide="ignore"):
        logits = x + np.log(prior)
    logits -= logits.max(0)
    e = np.exp(logits)
    return e / e.sum(0)


def trilinear(volume, grid):
    """Align-corners, taps outside count as zero; grid in [-1, 1], x y z."""
    at = (grid + 1) / 2 * (GRID - 1)
    low = np.floor(at).astype(int)
    part = at - low
    out = np.zeros(len(grid))
    for corner in range(8):
        bit = np.array([corner & 1, corner >> 1 & 1, corner >> 2])
        node = low + bit
        share = np.prod(np.where(bit, part, 1 - part), 1)
        inside = ((node >= 0) & (node < GRID)).all(1)
        n = node[inside]
        out[inside] += share[inside] * volume[n[:, 2], n[:, 1], n[:, 0]]
    return out


# ---------------------------------------------------------------- networks


def linear(net, name, x):
    return x @ net[name + ".weight"].T + net[name + ".bias"]


def bands(x, count):
    return [f(x * 2.0 ** k) for k in range(count) for f in (np.sin, np.cos)]


def non_rigid(net, points, posevec):
    alpha = BANDS_NON_RIGID * max(ITERATION - KICK_IN, 0) / (FULL - KICK_IN)
    window = [(1 - np.cos(np.pi * np.clip(alpha - k, 0, 1))) / 2 for k in range(BANDS_NON_RIGID)]
    encoded = bands(points, BANDS_NON_RIGID)
    embed = np.concatenate([encoded[i] * window[i // 2] for i in range(len(encoded))], 1)
    h = np.concatenate([np.tile(posevec, (len(points), 1)), embed], 1)
    for layer in range(6):
        if layer == 4:
            h = np.concatenate([h, embed], 1)
        h = np.maximum(linear(net, f"non_rigid_mlp.module.block_mlps.{2 * layer}", h), 0)
    return points + linear(net, "non_rigid_mlp.module.block_mlps.12", h)


def canonical(net, points):
    embed = np.concatenate([points] + bands(points, BANDS_CANONICAL), 1)
    h = embed
    for layer in range(8):
        if layer == 5:
            h = np.concatenate([embed, h], 1)
        h = np.maximum(linear(net, f"cnl_mlp.module.pts_linears.{2 * layer}", h), 0)
    return linear(net, "cnl_mlp.module.output_linear.0", h)


def corrections(net, posevec):
    h = posevec
    for layer in range(4):
        h = np.maximum(linear(net, f"pose_decoder.block_mlps.{2 * layer}", h), 0)
    vectors = linear(net, "pose_decoder.block_mlps.8", h).reshape(23, 3)
    rotations = []
    for v in vectors:
        angle = np.sqrt(1e-5 + v @ v)
        rotations.append(about(v / angle, angle))
    return rotations


# ---------------------------------------------------------------- a frame


def render(net, joints, frame, camera, size):
    poses = np.array(frame["pose"], np.float32).astype(np.float64).reshape(24, 3)
    # The root's motion goes to the camera: the whole body turns about the origin (Rh), and then
    # moves (Th) so that the pelvis is at its position in the capture.
    turn = exact_rotation(poses[0])
    pelvis = np.array(frame["translation"], np.float32) + joints[0]
    view = np.array(camera["E"]) @ rigid(turn, pelvis - turn @ joints[0])
    k = np.array(camera["K"])
    k[0, 2] -= 0.5
    k[1, 2] -= 0.5
    poses = poses.copy()
    poses[0] = 0
    posevec = poses.reshape(-1)[3:] + 1e-2

    rotations = [rotation(v) for v in poses]
    posed = chain([exact_rotation(v) for v in poses], joints)[:, :3, 3]
    for joint, correction in enumerate(corrections(net, posevec), 1):
        rotations[joint] = rotations[joint] @ correction
    rest = chain([np.eye(3)] * 24, joints)
    bases = rest @ np.linalg.inv(chain(rotations, joints))

    i, j = np.meshgrid(np.arange(size), np.arange(size))
    pixels = np.stack([i, j, np.ones_like(i)], -1).reshape(-1, 3)
    directions = (pixels @ np.linalg.inv(k).T) @ view[:3, :3]
    origin = -view[:3, :3].T @ view[:3, 3]
    directions[np.abs(directions) < 1e-5] = 1e-5
    low, high = box(posed)
    low, high = low - 0.01, high + 0.01
    hits = np.stack([(plane[a] - origin[a]) / directions[:, a]
                     for plane in (low, high) for a in range(3)], 1)
    places = origin + hits[..., None] * directions[:, None]
    on_box = ((places >= low - 1e-6) & (places <= high + 1e-6)).all(-1)
    meets = on_box.sum(1) == 2
    spans = np.abs(hits[meets][on_box[meets]].reshape(-1, 2))
    near, far = spans.min(1), spans.max(1)
    directions = directions[meets]

    t = np.linspace(0, 1, SAMPLES)
    z = near[:, None] * (1 - t) + far[:, None] * t
    points = (origin + z[..., None] * directions[:, None]).reshape(-1, 3)
    volume = weight_volume(net, prior_volume(joints))
    box_low, box_high = box(joints)
    sums, means = np.zeros(len(points)), np.zeros((len(points), 3))
    for bone in range(24):
        carried = points @ bases[bone, :3, :3].T + bases[bone, :3, 3]
        w = trilinear(volume[bone], (carried - box_low) * (2 / (box_high - box_low)) - 1)
        sums += w
        means += w[:, None] * carried
    means /= np.maximum(sums, 1e-4)[:, None]

    raw = np.zeros((len(points), 4))
    # A sample of no weight has an alpha of exactly 0.
    live = np.flatnonzero(sums)
    for part in np.array_split(live, max(1, len(live) // 65536)):
        raw[part] = canonical(net, non_rigid(net, means[part], posevec))
    steps = np.concatenate([np.diff(z, axis=1), np.full((len(z), 1), 1e10)], 1)
    steps *= np.linalg.norm(directions, axis=1)[:, None]
    raw = raw.reshape(len(z), SAMPLES, 4)
    alpha = 1 - np.exp(-np.maximum(raw[..., 3], 0) * steps)
    alpha *= sums.reshape(alpha.shape)
    clear = np.cumprod(1 - alpha + 1e-10, 1)
    weights = alpha * np.concatenate([np.ones((len(z), 1)), clear[:, :-1]], 1)
    colours = 1 / (1 + np.exp(-raw[..., :3]))
    picture = {"rgb": np.zeros((size * size, 3)), "alpha": np.zeros(size * size),
               "depth": np.zeros(size * size)}
    picture["rgb"][meets] = (weights[..., None] * colours).sum(1)
    picture["alpha"][meets] = weights.sum(1)
    picture["depth"][meets] = (weights * z).sum(1)
    return {name: v.reshape(size, size, *v.shape[1:]) for name, v in picture.items()}


# ---------------------------------------------------------------- the case


def networks(widths, rng):
    net = OrderedDict()

    def put(name, weight, scale=1.0, bias=0.05):
        net[name + ".weight"] = scale * weight
        outputs = weight.shape[1] if weight.ndim == 5 else weight.shape[0]
        net[name + ".bias"] = bias * rng.standard_normal(outputs)

    def dense(name, outputs, inputs, **more):
        put(name, np.sqrt(2 / inputs) * rng.standard_normal((outputs, inputs)), **more)

    decoder = "mweight_vol_decoder.decoder."
    net["mweight_vol_decoder.const_embedding"] = rng.standard_normal(widths["embedding"])
    dense(decoder + "block_mlp.0", widths["hidden"], widths["embedding"])
    channels = [widths["hidden"], *widths["channels"], 25]
    for layer, (inputs, outputs) in enumerate(zip(channels, channels[1:])):
        kernel = np.sqrt(2 / (8 * inputs)) * rng.standard_normal((inputs, outputs, 4, 4, 4))
        put(f"{decoder}block_conv.{2 * layer}", kernel, scale=0.7 if layer == 4 else 1.0)
    w = widths["non_rigid"]
    for layer in range(7):
        inputs = {0: 69 + 36, 4: w + 36}.get(layer, w)
        last = dict(scale=0.02, bias=0.01) if layer == 6 else {}
        dense(f"non_rigid_mlp.module.block_mlps.{2 * layer}", 3 if last else w, inputs, **last)
    w = widths["canonical"]
    for layer in range(8):
        dense(f"cnl_mlp.module.pts_linears.{2 * layer}", w, {0: 63, 5: w + 63}.get(layer, w))
    name = "cnl_mlp.module.output_linear.0"
    dense(name, 4, w)
    # A body that lets some light through.
    net[name + ".weight"][3] *= 12
    net[name + ".bias"][3] = 4.0
    w = widths["pose"]
    for layer in range(5):
        last = dict(scale=0.05, bias=0.02) if layer == 4 else {}
        dense(f"pose_decoder.block_mlps.{2 * layer}", 69 if last else w, w if layer else 69, **last)
    return OrderedDict((n, v.astype(np.float32)) for n, v in net.items())


def save_with_torch(torch, path, checkpoint):
    def convert(value):
        if isinstance(value, np.ndarray):
            return torch.from_numpy(value.copy())
        if isinstance(value, dict):
            return type(value)((k, convert(v)) for k, v in value.items())
        return value

    torch.save(convert(checkpoint), path)


def save_by_hand(path, checkpoint):
    """The format of torch.save: a zip with a pickle that names its storages, and the storages."""
    torch, utils = types.ModuleType("torch"), types.ModuleType("torch._utils")
    storage_kind = type("FloatStorage", (), {"__module__": "torch"})

    def rebuild(*_):
        raise NotImplementedError

    rebuild.__module__, rebuild.__name__ = "torch._utils", "_rebuild_tensor_v2"
    rebuild.__qualname__ = rebuild.__name__
    torch.FloatStorage, torch._utils, utils._rebuild_tensor_v2 = storage_kind, utils, rebuild
    storages = []

    class Storage:
        def __init__(self, values):
            self.key, self.count = str(len(storages)), values.size
            storages.append(values.tobytes())

    class Tensor:
        def __init__(self, values):
            self.storage, self.shape = Storage(values), values.shape

        def __reduce__(self):
            strides = tuple(int(np.prod(self.shape[a + 1:])) for a in range(len(self.shape)))
            return rebuild, (self.storage, 0, self.shape, strides, False, OrderedDict())

    def convert(value):
        if isinstance(value, np.ndarray):
            return Tensor(np.ascontiguousarray(value, np.float32))
        if isinstance(value, dict):
            return type(value)((k, convert(v)) for k, v in value.items())
        return value

    class Pickler(pickle.Pickler):
        def persistent_id(self, value):
            if isinstance(value, Storage):
                return "storage", storage_kind, value.key, "cpu", value.count
            return None

    kept = {name: sys.modules.get(name) for name in ("torch", "torch._utils")}
    sys.modules["torch"], sys.modules["torch._utils"] = torch, utils
    try:
        data = io.BytesIO()
        Pickler(data, 2).dump(convert(checkpoint))
    finally:
        for name, module in kept.items():
            if module is None:
                del sys.modules[name]
            else:
                sys.modules[name] = module
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr("archive/data.pkl", data.getvalue())
        archive.writestr("archive/byteorder", "little")
        for key, content in enumerate(storages):
            archive.writestr(f"archive/data/{key}", content)
        archive.writestr("archive/version", "3\n")


def save_safetensors(path, tensors):
    header, data = {}, b""
    for name, values in tensors.items():
        content = np.ascontiguousarray(values, "<f4").tobytes()
        offsets = [len(data), len(data) + len(content)]
        header[name] = {"dtype": "F32", "shape": list(values.shape), "data_offsets": offsets}
        data += content
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    path.write_bytes(struct.pack("<Q", len(text)) + text + data)


def look_at(eye, target):
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    r = np.stack([right, np.cross(forward, right), forward])
    return rigid(r, -r @ eye)


def main():
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("out", type=Path)
    arguments.add_argument("--small", action="store_true", help="narrow networks")
    arguments.add_argument("--size", type=int, default=64, help="side of the pictures, pixels")
    arguments.add_argument("--seed", type=int, default=1)
    options = arguments.parse_args()
    rng = np.random.default_rng(options.seed)
    options.out.mkdir(parents=True, exist_ok=True)

    joints = rest_joints()
    pose = np.float32(0.25 * rng.standard_normal((24, 3)))
    pose[0] = [0.1, 0.9, -0.05]
    target = np.array([0.12, 0.97, -0.21])
    frame = {"index": 3, "pose": pose.reshape(-1).astype(float).tolist(),
             "translation": [float(np.float32(v)) for v in target - joints[0]]}
    focal = 1.25 * options.size
    k = [[focal, 0, options.size / 2], [0, focal, options.size / 2 + 1], [0, 0, 1]]
    cameras = {
        "train": {"K": k, "E": look_at(np.array([0.3, 1.2, 2.6]), target).tolist()},
        "cam00": {"K": k, "E": look_at(np.array([-2.2, 1.6, 0.8]), target).tolist()},
    }
    (options.out / "poses.json").write_text(json.dumps({
        "skeleton": {"names": NAMES, "parents": PARENTS,
                     "rest_joints": joints.tolist()},
        "image_size": [options.size, options.size], "fps": 15.0,
        "frames": [{**frame, **cameras["train"]}],
        "eval": {"cam00": {**cameras["cam00"], "frames": [3]}},
    }))
    with open(options.out / "canonical_joints.pkl", "wb") as file:
        pickle.dump({"joints": joints.astype(np.float32)}, file)

    net = networks(SMALL_WIDTHS if options.small else FULL_WIDTHS, rng)
    checkpoint = {"iter": 60000, "network": net, "optimizer": {
        "state": {0: {"step": 60000, "exp_avg": net["pose_decoder.block_mlps.8.bias"]}},
        "param_groups": [{"lr": 5e-4, "betas": (0.9, 0.999), "params": [0]}]}}
    path = options.out / "checkpoint.tar"
    try:
        import torch
        save_with_torch(torch, path, checkpoint)
    except ImportError:
        save_by_hand(path, checkpoint)

    net = {name: values.astype(np.float64) for name, values in net.items()}
    expected = {}
    for name, camera in cameras.items():
        seen = render(net, joints, frame, camera, options.size)
        expected.update({f"{name}.{what}": values for what, values in seen.items()})
        print(f"{name}: mean alpha {seen['alpha'].mean():.4f}, largest {seen['alpha'].max():.4f}")
    save_safetensors(options.out / "expected.safetensors", expected)
    print(sum(v.size for v in net.values()), "parameters")


if __name__ == "__main__":
    main()
