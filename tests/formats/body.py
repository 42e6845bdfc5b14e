"""A synthetic body of SMPL's structure, with its joints in the world and in images."""

import sys
import types

import numpy as np

PARENTS = [-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21]
# A T-pose, metres, with the pelvis off the origin as in SMPL.
JOINTS = np.array([
    [0.0, -0.22, 0.03], [0.07, -0.31, 0.02], [-0.07, -0.31, 0.02], [0.0, -0.11, 0.0],
    [0.1, -0.7, 0.02], [-0.1, -0.7, 0.02], [0.0, 0.03, 0.0], [0.09, -1.1, -0.02],
    [-0.09, -1.1, -0.02], [0.0, 0.08, 0.02], [0.11, -1.16, 0.1], [-0.11, -1.16, 0.1],
    [0.0, 0.29, -0.01], [0.08, 0.2, 0.0], [-0.08, 0.2, 0.0], [0.0, 0.37, 0.04],
    [0.18, 0.22, -0.01], [-0.18, 0.22, -0.01], [0.44, 0.21, -0.03], [-0.44, 0.21, -0.03],
    [0.69, 0.22, -0.03], [-0.69, 0.22, -0.03], [0.78, 0.21, -0.04], [-0.78, 0.21, -0.04],
])
VERTICES, SHAPES = 60, 10


def rodrigues(v):
    v = np.asarray(v, float)
    angle = np.linalg.norm(v)
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = v / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


class Body:
    """Rest joints are means of two vertices each; further vertices have no weight."""

    def __init__(self, rng):
        offsets = rng.normal(0, 0.05, (24, 3))
        spare = rng.normal(0, 0.3, (VERTICES - 48, 3))
        self.v_template = np.concatenate([JOINTS + offsets, JOINTS - offsets, spare])
        self.shapedirs = rng.normal(0, 0.01, (VERTICES, 3, SHAPES))
        self.regressor = np.zeros((24, VERTICES))
        for joint in range(24):
            self.regressor[joint, [joint, joint + 24]] = 0.5

    def rest(self, betas):
        return self.regressor @ (self.v_template + self.shapedirs @ np.asarray(betas))

    def posed(self, poses, betas):
        """Joints of SMPL's forward pass: the root turns about the pelvis at its rest position."""
        rest, poses = self.rest(betas), np.asarray(poses).reshape(24, 3)
        rotations, places = [], []
        for joint, parent in enumerate(PARENTS):
            local = rodrigues(poses[joint])
            if parent < 0:
                rotations.append(local)
                places.append(rest[0])
            else:
                rotations.append(rotations[parent] @ local)
                places.append(places[parent] + rotations[parent] @ (rest[joint] - rest[parent]))
        return np.array(places)


def project(points, k, e):
    """Pixels of world points by a pinhole, in the coordinates of k."""
    seen = points @ e[:3, :3].T + e[:3, 3]
    return (seen / seen[:, 2:]) @ k[:2].T


def distorted(points, k, e, d):
    """As project, through OpenCV's lens model (k1 k2 p1 p2 k3)."""
    seen = points @ e[:3, :3].T + e[:3, 3]
    x, y = seen[:, 0] / seen[:, 2], seen[:, 1] / seen[:, 2]
    k1, k2, p1, p2, k3 = d
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    xd = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    yd = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return np.stack([xd, yd, np.ones_like(xd)], 1) @ k[:2].T


def chumpy_variable(x):
    """The pickled form of chumpy's Ch, without the library, which no longer installs."""
    module = sys.modules.get("chumpy.ch")
    if module is None:
        package, module = types.ModuleType("chumpy"), types.ModuleType("chumpy.ch")
        module.Ch = type("Ch", (), {"__module__": "chumpy.ch"})
        package.ch = module
        sys.modules.update({"chumpy": package, "chumpy.ch": module})
    variable = module.Ch()
    variable.x = x
    variable._dirty_vars = set()
    variable._itr = None
    return variable
