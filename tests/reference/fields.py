"""Encodings, the pose-conditioned code and both networks (YOTO eq. 3 to 5; HumanNeRF's networks).

Networks concatenate their extra inputs, as the paper draws them. The program multiplies each
part by its own rows of the weight instead; `Network.named` cuts the rows into those parts.
"""

import math

import torch

PRIMES = (1, 2654435761, 805459861)


def single(t):
    """Rounds to single precision, so that this project starts from the same numbers."""
    return t.float().double()


def frequencies(x, bands, unit=1.0, window=None):
    """[N, C] -> [N, 2 C bands]: a band's sines of all coordinates, then its cosines."""
    parts = []
    for band in range(bands):
        weight = 1.0 if window is None else window[band]
        parts += [weight * torch.sin(2**band * unit * x), weight * torch.cos(2**band * unit * x)]
    return torch.cat(parts, -1)


def hann_window(bands, a):
    """(1 - cos(pi clamp(a - k, 0, 1))) / 2."""
    return [(1 - math.cos(math.pi * min(max(a - k, 0.0), 1.0))) / 2 for k in range(bands)]


def pose_condition(parts, code, joints, bands):
    """Paper eq. 3 to 5."""
    features = frequencies(joints, bands, math.pi) @ parts["joints"]
    query, key, value = code @ parts["query"], features @ parts["key"], features @ parts["value"]
    scores = query @ key.T
    return torch.softmax(scores, -1) @ value + code


class HashGrid:
    """Multiresolution hash encoding (Mueller et al. 2022) over the cube at `low`."""

    def __init__(self, levels, base, growth, log2_rows, features, low, side):
        self.features, self.low, self.side = features, low, side
        self.levels, offset = [], 0
        for level in range(levels):
            cells = math.floor(base * growth**level)
            nodes = (cells + 1) ** 3
            rows = min(nodes, 2**log2_rows)
            self.levels.append((cells, offset, rows, nodes <= 2**log2_rows))
            offset += rows
        self.rows = offset

    def encode(self, table, points):
        """table [rows, F], points [N, 3] -> [N, L F]."""
        unit = ((points - self.low) / self.side).clamp(0, 1)
        encoded = []
        for cells, offset, rows, dense in self.levels:
            position = unit * cells
            low = position.detach().floor().clamp(0, cells - 1)
            part, total = position - low, 0.0
            for corner in range(8):
                bit = torch.tensor([corner & 1, corner >> 1 & 1, corner >> 2 & 1])
                share = torch.where(bit.bool(), part, 1 - part).prod(-1)
                x, y, z = (low.long() + bit).unbind(-1)
                if dense:
                    row = (z * (cells + 1) + y) * (cells + 1) + x
                else:
                    row = (x * PRIMES[0] & 0xFFFFFFFF) ^ (y * PRIMES[1] & 0xFFFFFFFF) ^ (z * PRIMES[2] & 0xFFFFFFFF)
                    row = row % rows
                total = total + share[:, None] * table[offset + row]
            encoded.append(total)
        return torch.cat(encoded, -1)


class Network:
    """Layers of ReLU; a layer's input is named by parts: the layer before (`weight`), the
    network's input once more (`skip`), a code (`code`)."""

    def __init__(self, path, layers, output, draw, output_scale=1.0):
        """`layers` lists, for each hidden layer, ([(part, width), ...] in concatenation order,
        width); `draw(*shape)` gives numbers of deviation 1."""
        self.path, self.layers = path, layers
        self.weights, self.biases = [], []
        for parts, width in [*layers, ([("weight", layers[-1][1])], output)]:
            rows = sum(count for _, count in parts)
            last = len(self.weights) == len(layers)
            scale = math.sqrt((1 if last else 2) / rows) * (output_scale if last else 1)
            self.weights.append(single(draw(rows, width) * scale).requires_grad_())
            self.biases.append(single(draw(width) * 0.1 * (output_scale if last else 1)).requires_grad_())

    def forward(self, x, codes):
        """`codes` maps a layer to its code [W]."""
        h = x
        for layer, (parts, _) in enumerate(self.layers):
            ways = {"weight": h, "skip": x}
            if layer in codes:
                ways["code"] = codes[layer].expand(x.shape[0], -1)
            joined = torch.cat([ways[part] for part, _ in parts], -1)
            h = torch.relu(joined @ self.weights[layer] + self.biases[layer])
        return h @ self.weights[-1] + self.biases[-1]

    def named(self, of=lambda leaf: leaf.detach()):
        """This project's names of `of` each parameter: rows split by part."""
        names = {}
        for layer, (weight, bias) in enumerate(zip(self.weights, self.biases)):
            hidden = layer < len(self.layers)
            path = f"{self.path}.hidden.{layer}" if hidden else f"{self.path}.output"
            parts = self.layers[layer][0] if hidden else [("weight", weight.shape[0])]
            blocks = of(weight).split([count for _, count in parts])
            names |= {f"{path}.{part}": block for (part, _), block in zip(parts, blocks)}
            names[f"{path}.bias"] = of(bias)
        return names

    def leaves(self):
        """All parameters."""
        return [*self.weights, *self.biases]


def density(raw, scale):
    """softplus(raw - 1), times the configuration's factor."""
    return torch.nn.functional.softplus(raw - 1) * scale
