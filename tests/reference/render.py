"""Rays, compositing and the objective (YOTO eq. 9; HumanNeRF's rays and losses)."""

import torch
import torch.nn.functional as F

BOX_MARGIN = 0.3
OPAQUE = 1e-10


def body_rays(intrinsics, extrinsics, to_world, pixels):
    """Rays of pixels [P, 2] in the body frame: origin [3], directions [P, 3] (camera z is 1)."""
    e = extrinsics @ to_world
    rotation, shift = e[:3, :3], e[:3, 3]
    homogeneous = torch.cat([pixels, torch.ones_like(pixels[:, :1])], 1)
    in_camera = homogeneous @ torch.linalg.inv(intrinsics).T
    return -rotation.T @ shift, in_camera @ rotation


def slabs(origin, directions, joints):
    """Entry and exit distances of rays in the posed joints' box, [P] each, and whether they hit it."""
    low, high = joints.min(0).values - BOX_MARGIN, joints.max(0).values + BOX_MARGIN
    one, other = (low - origin) / directions, (high - origin) / directions
    near = torch.minimum(one, other).max(-1).values.clamp_min(0)
    far = torch.maximum(one, other).min(-1).values
    return near, far, near < far


def composite(rgb, density, likelihood, steps, depths):
    """Samples [R, M, ...] -> colour [R, 3] over black, opacity [R], depth [R]."""
    alpha = (1 - torch.exp(-density * steps)) * likelihood
    passed = torch.cumprod(1 - alpha + OPAQUE, -1)
    before = torch.cat([torch.ones_like(passed[:, :1]), passed[:, :-1]], -1)
    weight = before * alpha
    return (weight[..., None] * rgb).sum(1), weight.sum(1), (weight * depths).sum(1)


def ssim(a, b, window=7, deviation=1.5):
    """Mean over windows inside the patch; a, b [P, 3, S, S], data range 1."""
    taps = torch.arange(window, dtype=a.dtype) - window // 2
    taps = torch.exp(-(taps**2) / (2 * deviation**2))
    kernel = torch.outer(taps, taps) / taps.sum() ** 2
    def blur(image):
        return F.conv2d(image, kernel.expand(3, 1, window, window), groups=3)
    mean_a, mean_b = blur(a), blur(b)
    variance_a, variance_b = blur(a * a) - mean_a**2, blur(b * b) - mean_b**2
    covariance = blur(a * b) - mean_a * mean_b
    c1, c2 = 0.01**2, 0.03**2
    top = (2 * mean_a * mean_b + c1) * (2 * covariance + c2)
    return (top / ((mean_a**2 + mean_b**2 + c1) * (variance_a + variance_b + c2))).mean()


def objective(predicted, truth, size, ssim_weight):
    """Mean squared error, and a share of 1 - SSIM; [P, S^2, 3] each."""
    images = [t.transpose(1, 2).reshape(-1, 3, size, size) for t in (predicted, truth)]
    return ((predicted - truth) ** 2).mean() + ssim_weight * (1 - ssim(*images))
