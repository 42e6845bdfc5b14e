"""Joint trees, rotations and bone transforms (HumanNeRF's body frame and motion bases).

Rotations are matrix exponentials, which need no case for small angles: they check the series
and quotients of this project without sharing their weaknesses.
"""

import torch

SMPL_NAMES = (
    "pelvis l_hip r_hip spine1 l_knee r_knee spine2 l_ankle r_ankle spine3 l_foot r_foot neck "
    "l_collar r_collar head l_shoulder r_shoulder l_elbow r_elbow l_wrist r_wrist l_hand r_hand"
).split()
SMPL_PARENTS = [-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21]
SMPL_TORSO = {0, 3, 6, 9, 13, 14}
SMPL_HEAD = 15
# A standing figure, metres: y up, one bone exactly along -y (each thigh), one along +y.
SMPL_REST = [
    [0.0, 0.0, 0.0], [0.07, -0.08, -0.01], [-0.07, -0.09, -0.01], [0.0, 0.11, -0.03],
    [0.07, -0.47, -0.01], [-0.11, -0.46, 0.0], [0.0, 0.25, -0.02], [0.09, -0.87, -0.05],
    [-0.09, -0.88, -0.04], [0.0, 0.3, 0.0], [0.11, -0.93, 0.08], [-0.11, -0.94, 0.08],
    [-0.01, 0.51, -0.03], [0.08, 0.42, -0.02], [-0.08, 0.42, -0.02], [-0.01, 0.59, 0.02],
    [0.17, 0.45, -0.03], [-0.17, 0.45, -0.03], [0.43, 0.44, -0.07], [-0.42, 0.44, -0.07],
    [0.68, 0.44, -0.07], [-0.67, 0.44, -0.08], [0.76, 0.43, -0.09], [-0.76, 0.43, -0.1],
]

# A small tree with a fork, a chain of three and a bone along -y.
SMALL_NAMES = ["pelvis", "spine", "head", "l_hip", "l_knee"]
SMALL_PARENTS = [-1, 0, 1, 0, 3]
SMALL_TORSO = {0, 1}
SMALL_HEAD = 2
SMALL_REST = [[0.02, 0.9, -0.03], [0.03, 1.15, -0.05], [0.05, 1.4, 0.0], [0.12, 0.8, 0.01], [0.12, 0.45, 0.01]]


def cross_matrix(r):
    """[..., 3] -> [..., 3, 3]: the matrix of the vector product with r."""
    x, y, z = r.unbind(-1)
    o = torch.zeros_like(x)
    return torch.stack([o, -z, y, z, o, -x, -y, x, o], -1).reshape(*r.shape[:-1], 3, 3)


def rotation(r):
    """[..., 3] axis-angle, radians -> [..., 3, 3]."""
    return torch.linalg.matrix_exp(cross_matrix(r))


def rigid(rotation_matrix, translation):
    """4x4 of a rotation and a translation."""
    top = torch.cat([rotation_matrix, translation[:, None]], 1)
    bottom = torch.tensor([[0.0, 0.0, 0.0, 1.0]], dtype=top.dtype)
    return torch.cat([top, bottom], 0)


def global_transforms(parents, rest, rotations):
    """Forward kinematics: one 4x4 per joint from local rotations [K, 3, 3]."""
    chain = []
    for joint, parent in enumerate(parents):
        if parent < 0:
            chain.append(rigid(rotations[joint], rest[joint]))
        else:
            chain.append(chain[parent] @ rigid(rotations[joint], rest[joint] - rest[parent]))
    return chain


def body_rotations(pose, correction=None):
    """Local rotations in the body frame, where the root is not rotated, from axis-angles [K, 3];
    each but the root's is followed by its correction [K - 1, 3, 3]."""
    local = rotation(pose[1:])
    if correction is not None:
        local = local @ correction
    return torch.cat([torch.eye(3, dtype=pose.dtype)[None], local], 0)


def bone_transforms(parents, rest, rotations):
    """[K, 3, 4]: G(rest) G(pose)^-1, posed body to canonical."""
    identity = torch.eye(3, dtype=rest.dtype).expand(len(parents), 3, 3)
    at_rest = global_transforms(parents, rest, identity)
    posed = global_transforms(parents, rest, rotations)
    return torch.stack([(a @ torch.linalg.inv(b))[:3] for a, b in zip(at_rest, posed)])


def joint_positions(parents, rest, rotations):
    """[K, 3] in the body frame."""
    return torch.stack([g[:3, 3] for g in global_transforms(parents, rest, rotations)])
