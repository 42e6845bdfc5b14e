//! Structural similarity of patches, with gradients. The Gaussian window is applied as two
//! products with a banded matrix, which is faster here than a convolution.

use burn::tensor::{Device, Tensor, TensorData};

/// Side length of the window, pixels. The 11 pixels of evaluation would leave little of a small
/// patch.
const WINDOW: usize = 7;
/// Standard deviation of the window, pixels (as in evaluation).
const WINDOW_STD: f64 = 1.5;
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// SSIM over patches of one size.
pub struct PatchSsim {
    size: usize,
    /// `[S, S − 6]`: each column holds the window at one position.
    window: Tensor<2>,
}

impl PatchSsim {
    /// SSIM over patches of `size`² pixels; `None` if they are smaller than the window.
    pub fn new(size: usize, device: &Device) -> Option<Self> {
        let positions = (size + 1)
            .checked_sub(WINDOW)
            .filter(|positions| *positions > 0)?;
        let taps: Vec<f64> = (0..WINDOW)
            .map(|i| {
                (-(i as f64 - (WINDOW / 2) as f64).powi(2) / (2.0 * WINDOW_STD * WINDOW_STD)).exp()
            })
            .collect();
        let total: f64 = taps.iter().sum();
        let mut values = vec![0f32; size * positions];
        for position in 0..positions {
            for (i, tap) in taps.iter().enumerate() {
                values[(position + i) * positions + position] = (tap / total) as f32;
            }
        }
        Some(Self {
            size,
            window: Tensor::from_data(TensorData::new(values, [size, positions]), device),
        })
    }

    /// Mean SSIM of `[P, S², 3]` patches with data range 1 → `[1]`.
    pub fn mean(&self, a: Tensor<3>, b: Tensor<3>) -> Tensor<1> {
        let [patches, _, _] = a.dims();
        let images = |t: Tensor<3>| {
            t.swap_dims(1, 2)
                .reshape([patches * 3, self.size, self.size])
        };
        let (a, b) = (images(a), images(b));
        // Five fields, blurred by one product.
        let fields = Tensor::cat(
            vec![
                a.clone(),
                b.clone(),
                a.clone().square(),
                b.clone().square(),
                a * b,
            ],
            0,
        );
        let across = fields.matmul(
            self.window
                .clone()
                .unsqueeze::<3>()
                .repeat_dim(0, 15 * patches),
        );
        let down = across.swap_dims(1, 2).matmul(
            self.window
                .clone()
                .unsqueeze::<3>()
                .repeat_dim(0, 15 * patches),
        );
        let [mean_a, mean_b, square_a, square_b, product]: [Tensor<3>; 5] = down
            .chunk(5, 0)
            .try_into()
            .expect("five fields of equal size");
        let means = mean_a.clone() * mean_b.clone();
        let squares = mean_a.clone().square() + mean_b.clone().square();
        let variances = square_a - mean_a.square() + square_b - mean_b.square();
        let covariance = product - means.clone();
        let top = (means * 2.0 + C1) * (covariance * 2.0 + C2);
        (top / ((squares + C1) * (variances + C2))).mean()
    }
}
