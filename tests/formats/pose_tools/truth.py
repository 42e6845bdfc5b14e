"""Two people who walk past a camera: their joints, key points and masks, before any tool's conventions."""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
import body as b  # noqa: E402

WIDTH, HEIGHT, FRAMES = 64, 96, 16
# √(W² + H²), which WHAM and GVHMR assume.
FOCAL = float(np.hypot(WIDTH, HEIGHT))
CENTRE = np.array([WIDTH / 2, HEIGHT / 2])
K = np.array([[FOCAL, 0, CENTRE[0]], [0, FOCAL, CENTRE[1]], [0, 0, 1]])
REST = b.JOINTS
PELVIS = REST[0]
# Half thickness of what hangs on each joint's bone from its parent, metres.
THICK = np.array([0, .1, .1, .12, .08, .08, .13, .06, .06, .13, .05, .05, .08, .1, .1, .07, .08, .08, .055, .055, .05, .05,
                  .045, .045])
HEAD = 0.12


def forward(poses, rest=REST):
    """Joints [24, 3] with the pelvis at rest, and global rotations [24, 3, 3]."""
    rotations, places = [], []
    for joint, parent in enumerate(b.PARENTS):
        local = b.rodrigues(np.asarray(poses).reshape(24, 3)[joint])
        if parent < 0:
            rotations.append(local)
            places.append(rest[0])
        else:
            rotations.append(rotations[parent] @ local)
            places.append(places[parent] + rotations[parent] @ (rest[joint] - rest[parent]))
    return np.array(places), np.array(rotations)


def vector(r):
    """The rotation vector of a matrix."""
    angle = np.arccos(np.clip((np.trace(r) - 1) / 2, -1, 1))
    axis = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    if np.linalg.norm(axis) < 1e-9:
        # No turn, or half a turn about the axis with the largest part.
        if angle < 1:
            return np.zeros(3)
        column = (r + np.eye(3))[:, np.argmax(np.diag(r))]
        return np.pi * column / np.linalg.norm(column)
    return angle * axis / np.linalg.norm(axis)


class Person:
    """Poses [F, 72], SMPL's translations t [F, 3] in the camera, and what follows from them."""

    def __init__(self, number, start, end, facing, phase):
        self.number = number
        self.poses, self.t = [], []
        for frame in range(FRAMES):
            swing = np.sin(2 * np.pi * frame / 12 + phase)
            pose = np.zeros((24, 3))
            along = frame / (FRAMES - 1)
            yaw = facing[0] + (facing[1] - facing[0]) * along
            # SMPL stands with y up; the camera looks with y down.
            pose[0] = vector(b.rodrigues([np.pi, 0, 0]) @ b.rodrigues([0.05, yaw, 0.03 * swing]))
            pose[1], pose[2] = [-0.45 * swing, 0, 0.05], [0.45 * swing, 0, -0.05]
            pose[4], pose[5] = [0.3 + 0.3 * swing, 0, 0], [0.3 - 0.3 * swing, 0, 0]
            pose[3], pose[6] = [0.05, 0.1 * swing, 0], [0.05, 0.05 * swing, 0]
            pose[12], pose[15] = [0.1, -0.1 * swing, 0], [0.05, 0.1, 0]
            pose[16], pose[17] = [0.35 * swing, -0.2, -1.1], [0.35 * swing, 0.2, 1.1]
            pose[18], pose[19] = [0, -0.5, 0], [0, 0.5, 0]
            pose[20], pose[21] = [0.1, 0, 0.1], [-0.1, 0, 0.1]
            self.poses.append(pose.reshape(72))
            self.t.append(np.array(start) + along * (np.array(end) - start) - PELVIS)
        self.poses, self.t = np.array(self.poses), np.array(self.t)
        bodies = [forward(pose) for pose in self.poses]
        # Joints with the pelvis at rest, as the tools' models return them.
        self.posed = np.array([joints for joints, _ in bodies])
        self.rotations = np.array([rotations for _, rotations in bodies])
        self.joints = self.posed + self.t[:, None]
        self.pixels = np.array([project(joints) for joints in self.joints])

    def matrices(self, frame):
        """Local rotations [24, 3, 3]."""
        return np.array([b.rodrigues(v) for v in self.poses[frame].reshape(24, 3)])

    def at(self, frame, joint, offset):
        """A point that a joint carries."""
        return self.joints[frame, joint] + self.rotations[frame, joint] @ np.array(offset)

    def points(self, frame):
        """Key points by name, in the camera."""
        joints = self.joints[frame]
        named = {
            "nose": self.at(frame, 15, [0, 0.04, 0.13]), "pelvis": joints[0], "neck": joints[12],
            "head_top": self.at(frame, 15, [0, 0.2, 0]),
        }
        for side, x, first in (("left", 1, 1), ("right", -1, 2)):
            hip, knee, ankle, foot = (joints[i] for i in (first, first + 3, first + 6, first + 9))
            shoulder, elbow, wrist, hand = (joints[i] for i in (first + 15, first + 17, first + 19, first + 21))
            named |= {
                f"{side}_eye": self.at(frame, 15, [0.035 * x, 0.07, 0.11]),
                f"{side}_ear": self.at(frame, 15, [0.08 * x, 0.04, 0.02]),
                f"{side}_shoulder": shoulder, f"{side}_elbow": elbow, f"{side}_wrist": wrist,
                f"{side}_hand": hand, f"{side}_hip": hip, f"{side}_knee": knee, f"{side}_ankle": ankle,
                f"{side}_big_toe": self.at(frame, first + 9, [-0.02 * x, -0.02, 0.07]),
                f"{side}_small_toe": self.at(frame, first + 9, [0.05 * x, -0.02, 0.05]),
                f"{side}_heel": self.at(frame, first + 6, [0, -0.05, -0.05]),
                f"{side}_foot": foot,
            }
        return named

    def mask(self, frame):
        """[H, W], true near the bones."""
        shape = np.zeros((HEIGHT, WIDTH), bool)
        v, u = np.mgrid[:HEIGHT, :WIDTH]
        ends = [(j, b.PARENTS[j], THICK[j]) for j in range(1, 24)]
        places = np.vstack([self.joints[frame], self.at(frame, 15, [0, 0.08, 0.02])])
        for start, end, thick in [*ends, (24, 15, HEAD)]:
            a, c = project(places[[start, end]])
            along = c - a
            share = ((u - a[0]) * along[0] + (v - a[1]) * along[1]) / max(along @ along, 1e-9)
            share = np.clip(share, 0, 1)
            far = np.hypot(u - a[0] - share * along[0], v - a[1] - share * along[1])
            shape |= far <= thick * FOCAL / places[[start, end], 2].mean()
        return shape

    def box(self, frame):
        """x0, y0, x1, y1 of the mask's pixels, the ends beyond it."""
        rows, columns = np.nonzero(self.mask(frame))
        return np.array([columns.min(), rows.min(), columns.max() + 1, rows.max() + 1], float)


def project(points, k=K):
    """Pixels [N, 2], counted from the first pixel's centre."""
    points = np.asarray(points)
    return (points @ k.T)[:, :2] / points[:, 2:]


def placed(posed, pixels, k):
    """The translation that brings joints closest to pixels through another camera."""
    rows, values = [], []
    for (x, y, z), (u, v) in zip(posed, pixels):
        for axis, (at, seen) in enumerate(((x, u), (y, v))):
            row = np.zeros(3)
            slope = (seen - k[axis, 2]) / k[axis, axis]
            row[axis], row[2] = 1, -slope
            rows.append(row)
            values.append(slope * z - at)
    return np.linalg.lstsq(np.array(rows), np.array(values), rcond=None)[0]


def pinhole(focal):
    """A camera with its centre in the middle of the image."""
    return np.array([[focal, 0, CENTRE[0]], [0, focal, CENTRE[1]], [0, 0, 1]])


def pictures(folder, people):
    """The clip as PNGs, and masks in SAM 2's palette form: 0, or the number of the person. The first
    of the people is nearest; the second is there in some frames."""
    (folder / "frames").mkdir(parents=True)
    (folder / "masks").mkdir()
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    for frame in range(FRAMES):
        image = np.stack([60 + u // 2, 70 + v // 4, np.full_like(u, 90)], -1).astype(np.uint8)
        labels = np.zeros((HEIGHT, WIDTH), np.uint8)
        # The farther first.
        for person in people[::-1] if frame in SEEN else people[:1]:
            mask = person.mask(frame)
            labels[mask] = person.number
            image[mask] = [[220, 170, 130], [130, 190, 220]][person.number - 1]
            image[mask & ((v + 3 * person.number) % 8 < 2)] = [200, 60, 60]
        Image.fromarray(image).save(folder / f"frames/{frame:06d}.png", optimize=True)
        palette = Image.fromarray(labels, "P")
        palette.putpalette([0, 0, 0, 128, 0, 0, 0, 128, 0])
        palette.save(folder / f"masks/{frame:05d}.png", optimize=True)


# The first stays in front; the second is behind, to the right, and there in the frames SEEN alone.
FIRST = Person(1, [-0.3, -0.08, 3.0], [0.05, -0.05, 2.8], (-0.7, 0.8), 0.0)
SECOND = Person(2, [0.75, 0.1, 4.6], [0.95, 0.1, 4.9], (0.4, 1.2), 1.0)
SEEN = range(3, 12)
