"""LPIPS by the `lpips` package, for worker/avatar/tests/lpips.rs.

    pip install torch torchvision lpips safetensors
    python tests/reference/lpips_case.py

Writes into worker/avatar/tests/cases:

* lpips.safetensors: two images [1, 3, 64, 64] in [0, 1], their distance in float64, its
  gradient to the first image, and the distance of their upper left 33 x 47 pixels (sides that
  poolings don't divide). The 14.7 million weights are not kept: they come from `numbers`,
  which the test repeats.
* lpips_vgg16.pth and lpips_heads.pth: files by `torch.save`, the first in the format of
  PyTorch before 1.6 as torchvision's are, the second in today's; `distance.files` is the
  distance with them. VGG's tensors overlap in one small storage, so that the file is small.
"""

import argparse
from pathlib import Path

import lpips
import numpy as np
import torch
from safetensors.numpy import save_file

# Outputs of the convolutions; 0 is a pooling.
LAYERS = [64, 64, 0, 128, 128, 0, 256, 256, 256, 0, 512, 512, 512, 0, 512, 512, 512]
HEADS = [64, 128, 256, 512, 512]
# Steps through the shared storage along a kernel's four axes.
STEPS = (37, 11, 3, 1)


def numbers(name, count):
    """Multiples of 2^-23 in [-1, 1): splitmix64 over the FNV-1a hash of the name."""
    with np.errstate(over="ignore"):
        seed = np.uint64(0xCBF29CE484222325)
        for byte in name.encode():
            seed = (seed ^ np.uint64(byte)) * np.uint64(0x100000001B3)
        z = seed + np.arange(1, count + 1, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15)
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        z = z ^ (z >> np.uint64(31))
    return (z >> np.uint64(40)).astype(np.float64) / 2.0**23 - 1.0


def convolutions():
    """Torchvision's number and the shape of each convolution."""
    place, inputs = 0, 3
    for outputs in LAYERS:
        if outputs == 0:
            place += 1
            continue
        yield place, (outputs, inputs, 3, 3)
        place, inputs = place + 2, outputs


def generated(name, shape):
    """A tensor by its name: kernels with He scaling, heads in [0, 1)."""
    values = numbers(name, int(np.prod(shape)))
    if name.startswith("lin"):
        values = (values + 1.0) / 2.0
    elif name.endswith("weight"):
        values = values * np.sqrt(6.0 / (shape[1] * 9))
    else:
        values = values * 0.05
    return torch.from_numpy(values.astype(np.float32).reshape(shape))


def shapes():
    for place, shape in convolutions():
        yield f"features.{place}.weight", shape
        yield f"features.{place}.bias", shape[:1]
    for layer, channels in enumerate(HEADS):
        yield f"lin{layer}.model.1.weight", (1, channels, 1, 1)


def network(weights):
    """The package's network with these weights, in double precision."""
    model = lpips.LPIPS(net="vgg", pretrained=False, pnet_rand=True, verbose=False)
    backbone = {}
    for name, parameter in model.net.named_parameters():
        # slice3.12.weight is torchvision's features.12.weight.
        backbone["features." + name.split(".", 1)[1]] = parameter
    with torch.no_grad():
        for name, tensor in weights.items():
            if name.startswith("lin"):
                getattr(model, name[:4]).model[1].weight.copy_(tensor)
            else:
                backbone.pop(name).copy_(tensor)
    assert not backbone, f"not filled: {list(backbone)}"
    return model.double()


def picture(name):
    """Coarse squares and fine noise, float32 in [0, 1)."""
    squares = (numbers(name + ".squares", 3 * 64).reshape(3, 8, 8) + 1.0) / 2.0
    noise = (numbers(name + ".noise", 3 * 64 * 64).reshape(3, 64, 64) + 1.0) / 2.0
    image = 0.8 * squares.repeat(8, axis=1).repeat(8, axis=2) + 0.2 * noise
    return image.astype(np.float32)[None]


def overlapping():
    """VGG's tensors as views of one storage of kernels and one of biases."""
    size = 511 * STEPS[0] + 511 * STEPS[1] + 2 * STEPS[2] + 2 * STEPS[3] + 1
    kernels = torch.from_numpy((numbers("kernels", size) * 0.04).astype(np.float32))
    biases = torch.from_numpy((numbers("biases", 512) * 1e-3).astype(np.float32))
    tensors = {}
    for place, shape in convolutions():
        tensors[f"features.{place}.weight"] = kernels.as_strided(shape, STEPS)
        tensors[f"features.{place}.bias"] = biases[: shape[0]]
    return tensors


def main():
    parser = argparse.ArgumentParser()
    cases = Path(__file__).parents[2] / "worker/avatar/tests/cases"
    parser.add_argument("--out", type=Path, default=cases)
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)

    truth, other = picture("truth"), picture("other")
    near = (0.7 * truth + 0.3 * other).astype(np.float32)
    weights = {name: generated(name, shape) for name, shape in shapes()}
    model = network(weights)
    a = torch.from_numpy(near).double().requires_grad_()
    b = torch.from_numpy(truth).double()
    distance = model(a, b, normalize=True)
    (gradient,) = torch.autograd.grad(distance.sum(), a)
    part = model(a[..., :33, :47], b[..., :33, :47], normalize=True)

    single = network(weights).float()
    s = torch.from_numpy(near).requires_grad_()
    in_single = single(s, torch.from_numpy(truth), normalize=True)
    (gradient_in_single,) = torch.autograd.grad(in_single.sum(), s)
    worst = (gradient_in_single.double() - gradient).abs().max() / gradient.abs().max()
    print(f"lpips with torch {torch.__version__}: {distance.item():.12f}, part {part.item():.12f}")
    print(f"in float32: distance {abs(in_single.item() / distance.item() - 1):.1e} off,", end=" ")
    print(f"gradient {worst.item():.1e} of its largest")

    backbone = overlapping()
    heads = {f"lin{i}.model.1.weight": weights[f"lin{i}.model.1.weight"] for i in range(5)}
    torch.save(backbone, out / "lpips_vgg16.pth", _use_new_zipfile_serialization=False)
    torch.save(heads, out / "lpips_heads.pth")
    files = network(backbone | heads)(a, b, normalize=True)
    print(f"with the files: {files.item():.12f}")

    save_file(
        {
            "image.a": near,
            "image.b": truth,
            "distance": distance.detach().numpy().reshape(1),
            "distance.part": part.detach().numpy().reshape(1),
            "distance.files": files.detach().numpy().reshape(1),
            "gradient.a": gradient.numpy().astype(np.float32),
        },
        out / "lpips.safetensors",
    )


if __name__ == "__main__":
    main()
