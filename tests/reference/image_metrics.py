"""Image metrics by scikit-image, for the tests of `yoto_avatar::evaluate`.

    pip install scikit-image numpy
    python tests/reference/image_metrics.py

Prints the numbers in worker/avatar/src/evaluate/{metrics,ssim}.rs. The pictures
are made by a formula that both sides compute, so that no data has to be kept. They are
float32, as rendered pictures are, and are compared in float64.

What scikit-image does without `data_range`: 0.18 and 0.19 take the range of the data type,
which is 2 for floats (-1 to 1), whatever the values are; 0.20 and later refuse. Tables made
with [0, 1] floats by the former are inflated, since the constants C1 and C2 grow fourfold.
"""

import numpy as np
import skimage
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

WIDTH, HEIGHT = 19, 14


def picture(seed):
    i = np.arange(HEIGHT * WIDTH * 3)
    values = ((i * 37 + seed * 101) % 97).astype(np.float32) / np.float32(97)
    return values.reshape(HEIGHT, WIDTH, 3).astype(np.float64)


def blended(a, b):
    """A picture close to `a`, as a good render is close to the truth."""
    near = a.astype(np.float32) * np.float32(0.875) + b.astype(np.float32) * np.float32(0.125)
    return near.astype(np.float64)


def main():
    print("scikit-image", skimage.__version__)
    truth = picture(0)
    for name, render in [("unrelated", picture(3)), ("near", blended(truth, picture(3)))]:
        same = dict(channel_axis=2)
        rows = {
            "psnr": peak_signal_noise_ratio(truth, render, data_range=1),
            "gaussian": structural_similarity(
                truth,
                render,
                gaussian_weights=True,
                sigma=1.5,
                use_sample_covariance=False,
                data_range=1,
                **same,
            ),
            "uniform": structural_similarity(truth, render, data_range=1, **same),
            "inflated": structural_similarity(truth, render, data_range=2, **same),
        }
        for key, value in rows.items():
            print(f"{name:10} {key:9} {value:.15f}")


if __name__ == "__main__":
    main()
