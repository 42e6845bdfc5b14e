"""BVH files of one motion, as the programs and data sets write them that people have motions from.

Names, hierarchy, order of channels, axes of the joints and what the rest pose looks like are those of the
dialects; lengths and the motion are made up. Each file comes with the rotation of every joint from
a T-pose that faces +z.

`python3 tests/formats/bvh_dialects.py` writes `captures/bvh/DIALECT.bvh` and `captures/bvh/dialects.json`.
"""

import json
from pathlib import Path

import numpy as np

from body import rodrigues

OUT = Path(__file__).parent / "captures" / "bvh"

# Parent and place from it in a T-pose that faces +z, centimetres.
BODY = {
    "pelvis": (None, [0, 95, 0]),
    "spine1": ("pelvis", [0, 10, 0]), "spine2": ("spine1", [0, 12, 0]),
    "spine3": ("spine2", [0, 12, 0]), "neck": ("spine3", [0, 20, 0]), "head": ("neck", [0, 10, 0]),
}
for side, x in (("l", 1), ("r", -1)):
    BODY.update({
        f"{side}_hip": ("pelvis", [9 * x, -3, 0]), f"{side}_knee": (f"{side}_hip", [0, -42, 0]),
        f"{side}_ankle": (f"{side}_knee", [0, -41, 0]), f"{side}_foot": (f"{side}_ankle", [0, -8, 13]),
        f"{side}_collar": ("spine3", [4 * x, 13, 0]), f"{side}_shoulder": (f"{side}_collar", [13 * x, 2, 0]),
        f"{side}_elbow": (f"{side}_shoulder", [29 * x, 0, 0]), f"{side}_wrist": (f"{side}_elbow", [25 * x, 0, 0]),
    })


def turns(frame):
    """Local rotations of the motion: a T-pose, then standing, then steps with bent knees and a turn."""
    if frame == 0:
        return {}
    arms = {"l_shoulder": [0, 0, -1.4], "r_shoulder": [0, 0, 1.4]}
    if frame == 1:
        return {"pelvis": [0, 0.6, 0], **arms}
    swing = np.sin(1.3 * frame)
    return {
        "pelvis": [0.25, 0.6 + 0.3 * frame, 0.05], "spine2": [0.3, 0.2 * swing, 0.1],
        "neck": [0.1, -0.3, 0.0], "l_hip": [-0.9 + 0.3 * swing, 0.1, 0.1], "r_hip": [-0.5 - 0.3 * swing, 0, -0.1],
        "l_knee": [1.2, 0, 0], "r_knee": [0.9, 0, 0], "l_ankle": [-0.2, 0, 0],
        "l_shoulder": [0.4 * swing, -0.5, -1.0], "r_shoulder": [-0.4 * swing, 0.6, 0.8],
        "l_elbow": [0, -0.8, 0], "r_elbow": [0, 0.7, 0], "l_wrist": [0.3, 0, 0.2],
    }


def posed(frame, facing):
    """Global rotations, and the places of the joints."""
    local, rotations, places = turns(frame), {}, {}
    for joint, (parent, offset) in BODY.items():
        turn = rodrigues(local.get(joint, [0, 0, 0]))
        if parent is None:
            rotations[joint] = rodrigues([0, facing, 0]) @ turn
            places[joint] = np.array([5.0 * frame, offset[1], 20.0 * frame])
        else:
            rotations[joint] = rotations[parent] @ turn
            places[joint] = places[parent] + rotations[parent] @ np.array(offset, float)
    return rotations, places


def axes(x, y):
    """The rotation whose first two columns are x and y."""
    x, y = np.array(x, float), np.array(y, float)
    return np.stack([x, y, np.cross(x, y)], 1)


# Axes of the joints in a T-pose, of dialects whose bones lie along x. Columns: the joint's own x, y.
UP = axes([0, 1, 0], [0, 0, 1])
ALONG_X = {"pelvis": UP, "neck": UP, "head": UP, "spine1": UP, "spine2": UP, "spine3": UP}
for side, x in (("l", 1), ("r", -1)):
    ALONG_X.update({f"{side}_{joint}": axes([0, -1, 0], [0, 0, 1]) for joint in ("hip", "knee", "ankle")})
    ALONG_X[f"{side}_foot"] = axes([0, 0, 1], [0, 1, 0])
    ALONG_X.update({
        f"{side}_{joint}": axes([x, 0, 0], [0, 0, 1]) for joint in ("collar", "shoulder", "elbow", "wrist")
    })
# The same with the bones of the right side along -x.
MIRRORED = dict(ALONG_X)
for joint in BODY:
    if joint.startswith("r_"):
        MIRRORED[joint] = ALONG_X[joint] @ np.diag([-1.0, 1.0, -1.0])
# The same with hips whose own axes are the world's.
UPRIGHT_HIPS = {**ALONG_X, "pelvis": np.eye(3)}
# Thighs and shins splayed by 20 degrees at rest, as in CMU's own skeletons.
SPLAYED = {
    f"{side}_{joint}": rodrigues([0, 0, -np.radians(20) * x])
    for side, x in (("l", 1), ("r", -1)) for joint in ("hip", "knee")
}


def sides(names):
    """Names of both sides, from those of one with {} for "Left" or "l" and its like."""
    def both(left, right):
        return {f"{s}_{joint}": name.format(word) for s, word in (("l", left), ("r", right))
                for joint, name in names.items()}
    return both


LONG = ("Left", "Right")
MIXAMO = {"pelvis": "Hips", "spine1": "Spine", "spine2": "Spine1", "spine3": "Spine2", "neck": "Neck", "head": "Head",
          **sides({"hip": "{}UpLeg", "knee": "{}Leg", "ankle": "{}Foot", "foot": "{}ToeBase", "collar": "{}Shoulder",
                   "shoulder": "{}Arm", "elbow": "{}ForeArm", "wrist": "{}Hand"})(*LONG)}
DIALECTS = {
    "cmu": dict(
        order="ZYX", root="ZYX", axes=SPLAYED, first=0,
        # Joints that stand where their parents do.
        between={"LHipJoint": "l_hip", "RHipJoint": "r_hip"},
        names={"pelvis": "Hips", "spine1": "LowerBack", "spine2": "Spine", "spine3": "Spine1",
               "neck": "Neck", "head": "Head",
               **sides({"hip": "{}UpLeg", "knee": "{}Leg", "ankle": "{}Foot", "foot": "{}ToeBase",
                        "collar": "{}Shoulder", "shoulder": "{}Arm", "elbow": "{}ForeArm", "wrist": "{}Hand"})(*LONG)}),
    "cmu_daz": dict(
        order="ZXY", root="ZYX", axes={}, first=0, between={"lButtock": "l_hip", "rButtock": "r_hip"},
        names={"pelvis": "hip", "spine1": "abdomen", "spine2": "chest", "neck": "neck", "head": "head",
               **sides({"hip": "{}Thigh", "knee": "{}Shin", "ankle": "{}Foot", "collar": "{}Collar",
                        "shoulder": "{}Shldr", "elbow": "{}ForeArm", "wrist": "{}Hand"})("l", "r")}),
    "xsens": dict(
        order="YXZ", root="YXZ", axes={}, first=1, between={},
        names={"pelvis": "Hips", "spine1": "Chest", "spine2": "Chest2", "spine3": "Chest3", "neck": "Neck", "head": "Head",
               **sides({"hip": "{}Hip", "knee": "{}Knee", "ankle": "{}Ankle", "foot": "{}Toe", "collar": "{}Collar",
                        "shoulder": "{}Shoulder", "elbow": "{}Elbow", "wrist": "{}Wrist"})(*LONG)}),
    "lafan1": dict(
        order="ZYX", root="ZYX", axes=ALONG_X, first=1, between={},
        names={joint: name.replace("ToeBase", "Toe") for joint, name in MIXAMO.items()}),
    "mixamo_blender": dict(
        order="XYZ", root="XYZ", axes={}, first=0, between={}, positions=True,
        names={joint: f"mixamorig:{name}" for joint, name in MIXAMO.items()}),
    "rokoko": dict(order="YXZ", root="YXZ", axes=UPRIGHT_HIPS, first=1, between={}, names=MIXAMO),
    "bandai_namco": dict(
        order="ZXY", root="ZXY", axes=MIRRORED, first=1, between={}, above="joint_Root", positions=True,
        names={"pelvis": "Hips", "spine1": "Spine", "spine2": "Chest", "neck": "Neck", "head": "Head",
               **sides({"hip": "UpperLeg_{}", "knee": "LowerLeg_{}", "ankle": "Foot_{}", "foot": "Toes_{}",
                        "collar": "Shoulder_{}", "shoulder": "UpperArm_{}", "elbow": "LowerArm_{}", "wrist": "Hand_{}"})("L", "R")}),
}


def euler(r, order):
    """Degrees of rotations about the axes of `order`, the first outermost."""
    i, j, k = ("XYZ".index(axis) for axis in order)
    sign = 1.0 if (i, j, k) in ((0, 1, 2), (1, 2, 0), (2, 0, 1)) else -1.0
    second = np.arcsin(np.clip(sign * r[i, k], -1, 1))
    if abs(r[i, k]) > 1 - 1e-9:
        # Gimbal lock: the third axis is the first.
        return np.degrees([np.arctan2(sign * r[k, j], r[j, j]), second, 0.0])
    first = np.arctan2(-sign * r[j, k], r[k, k])
    third = np.arctan2(-sign * r[i, j], r[i, i])
    return np.degrees([first, second, third])


def bvh(dialect, frames):
    """The file, and the rotations of its joints by the names of people's joints."""
    names, own = dialect["names"], dialect["axes"]
    axis = lambda joint: own.get(joint, np.eye(3))

    def parent(joint):
        above = BODY[joint][0]
        while above is not None and above not in names:
            above = BODY[above][0]
        return above

    first_rotations, first_places = posed(0, 0.0)
    offset = {}
    for joint in names:
        above = parent(joint)
        if above is None:
            offset[joint] = np.array([0.0, 0.0, 0.0])
        else:
            offset[joint] = axis(above).T @ (first_places[joint] - first_places[above])
    lines, order = ["HIERARCHY"], []

    def channels(at_root):
        word = dialect["root"] if at_root else dialect["order"]
        turning = " ".join(f"{a}rotation" for a in word)
        if at_root or dialect.get("positions"):
            return f"CHANNELS 6 Xposition Yposition Zposition {turning}"
        return f"CHANNELS 3 {turning}"

    def open_joint(kind, name, at, depth):
        pad = "\t" * depth
        lines.extend([f"{pad}{kind} {name}", pad + "{", f"{pad}\tOFFSET {at[0]:.6f} {at[1]:.6f} {at[2]:.6f}",
                      f"{pad}\t{channels(kind == 'ROOT')}"])

    def write(joint, depth, kind="JOINT"):
        at = offset[joint]
        extra = next((n for n, below in dialect["between"].items() if below == joint), None)
        if extra:
            open_joint("JOINT", extra, np.zeros(3), depth)
            order.append(None)
            depth += 1
        open_joint(kind, names[joint], at, depth)
        order.append(joint)
        children = [c for c in names if parent(c) == joint]
        for child in children:
            write(child, depth + 1)
        pad = "\t" * depth
        if not children:
            lines.extend([pad + "\tEnd Site", pad + "\t{", pad + "\t\tOFFSET 0 5 0", pad + "\t}"])
        lines.append(pad + "}")
        if extra:
            lines.append("\t" * (depth - 1) + "}")

    if dialect.get("above"):
        open_joint("ROOT", dialect["above"], np.zeros(3), 0)
        order.append("above")
        write("pelvis", 1)
        lines.append("}")
    else:
        write("pelvis", 0, "ROOT")

    facing = 0.4
    frames = [f for f in frames if f >= dialect["first"]]
    lines += ["MOTION", f"Frames: {len(frames)}", "Frame Time: 0.0333333"]
    expected = []
    for frame in frames:
        rotations, places = posed(frame, facing)
        row, seen_root = [], False
        for joint in order:
            is_root = not seen_root
            seen_root = True
            word = dialect["root"] if is_root else dialect["order"]
            if joint in (None, "above"):
                if is_root or dialect.get("positions"):
                    row += [0.0, 0.0, 0.0]
                row += [0.0, 0.0, 0.0]
                continue
            above = parent(joint)
            if above is None:
                row += list(places[joint])
                local = rotations[joint] @ axis(joint)
            else:
                if dialect.get("positions"):
                    row += list(offset[joint])
                local = (rotations[above] @ axis(above)).T @ rotations[joint] @ axis(joint)
            row += list(euler(local, word))
        lines.append(" ".join(f"{v:.6f}" for v in row))
        expected.append({"rotations": {joint: rotations[joint].tolist() for joint in names},
                         "places": {joint: places[joint].tolist() for joint in names}})
    return "\n".join(lines) + "\n", expected


def write():
    expected = {}
    for name, dialect in DIALECTS.items():
        text, frames = bvh(dialect, range(5))
        (OUT / f"{name}.bvh").write_text(text)
        expected[name] = {"matched": dialect["names"], "frames": frames}
    text = json.loads(json.dumps(expected), parse_float=lambda text: round(float(text), 6))
    (OUT / "dialects.json").write_text(json.dumps(text))


if __name__ == "__main__":
    write()
