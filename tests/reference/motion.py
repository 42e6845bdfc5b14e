"""Motion weights and the warp (YOTO eq. 1; HumanNeRF's motion weights)."""

import torch
import torch.nn.functional as F

BOX_MARGIN = 0.3
BONE_DEVIATION = (0.03, 0.06, 0.03)
TORSO_FACTOR = 1.5
LEAF_DEVIATION = 0.02
HEAD_DEVIATION = 0.06
# This project's choice where HumanNeRF takes the logarithm of an exact zero.
LEAST_PRIOR = 1e-12


def canonical_box(rest):
    """Corners of the canonical box."""
    return rest.min(0).values - BOX_MARGIN, rest.max(0).values + BOX_MARGIN


def from_y(direction):
    """The rotation that takes +y to a unit direction; half a turn about x for -y."""
    c = direction[1]
    if c < -1 + 1e-12:
        return torch.diag(torch.tensor([1.0, -1.0, -1.0], dtype=direction.dtype))
    x, _, z = direction
    o = torch.zeros_like(x)
    # v = y x direction = (z, 0, -x)
    v = torch.stack([o, x, o, -x, o, -z, o, z, o]).reshape(3, 3)
    return torch.eye(3, dtype=direction.dtype) + v + v @ v / (1 + c)


def gaussian(nodes, middle, matrix, scales):
    """exp(-d^T R S^2 R^T d) at nodes [..., 3]."""
    local = (nodes - middle) @ matrix
    return torch.exp(-((local * scales) ** 2).sum(-1))


def prior(parents, torso, head, rest, resolution):
    """[K + 1, D, D, D] in the order channel, z, y, x; the background is last."""
    low, high = canonical_box(rest)
    axes = [torch.linspace(0, 1, resolution, dtype=rest.dtype) * (high[a] - low[a]) + low[a] for a in range(3)]
    z, y, x = torch.meshgrid(axes[2], axes[1], axes[0], indexing="ij")
    nodes = torch.stack([x, y, z], -1)
    channels = []
    for joint in range(len(parents)):
        children = [c for c, p in enumerate(parents) if p == joint]
        volume = torch.zeros_like(x)
        for child in children:
            bone = rest[child] - rest[joint]
            scales = 1 / (2 * torch.tensor(BONE_DEVIATION, dtype=rest.dtype))
            if joint in torso:
                scales = scales / torch.tensor([TORSO_FACTOR, 1.0, TORSO_FACTOR], dtype=rest.dtype)
            volume = volume + gaussian(nodes, (rest[joint] + rest[child]) / 2, from_y(bone / bone.norm()), scales)
        if not children:
            deviation = HEAD_DEVIATION if joint == head else LEAF_DEVIATION
            scales = torch.full((3,), 1 / (2 * deviation), dtype=rest.dtype)
            volume = gaussian(nodes, rest[joint], torch.eye(3, dtype=rest.dtype), scales)
        channels.append(volume)
    channels = torch.stack(channels)
    background = 1 - channels.sum(0, keepdim=True).clamp(0, 1)
    everything = torch.cat([channels, background])
    return everything / everything.sum(0, keepdim=True).clamp_min(1e-3)


def weight_volume(base, residual, prior_volume):
    """softmax over channels of base + residual + log prior, all [K + 1, D^3]."""
    return torch.softmax(base + residual + prior_volume.clamp_min(LEAST_PRIOR).log(), 0)


def decode(embedding, linear, bias, kernels, biases):
    """HumanNeRF's decoder: embedding [E] -> logits [K + 1, D^3]."""
    hidden = F.leaky_relu(embedding @ linear + bias, 0.2)
    volume = hidden.reshape(1, -1, 1, 1, 1)
    for layer, (kernel, offset) in enumerate(zip(kernels, biases)):
        volume = F.conv_transpose3d(volume, kernel, offset, stride=2, padding=1)
        if layer < len(kernels) - 1:
            volume = F.leaky_relu(volume, 0.2)
    return volume.reshape(volume.shape[1], -1)


def warp(weights, transforms, points, low, high):
    """weights [K, D, D, D], transforms [K, 3, 4], points [N, 3] -> x_c [N, 3], likelihood [N]."""
    carried = torch.einsum("kij,nj->kni", transforms[:, :, :3], points) + transforms[:, None, :, 3]
    unit = (carried - low) * (2 / (high - low)) - 1
    sampled = F.grid_sample(
        weights[:, None], unit[:, None, None], mode="bilinear", padding_mode="zeros", align_corners=True
    )[:, 0, 0, 0]
    total = sampled.sum(0)
    canonical = (sampled[:, :, None] * carried).sum(0) / total.clamp_min(1e-4)[:, None]
    return canonical, total.clamp(0, 1)
