//! The loss in Burn's own tensor operations; the window is a product with banded matrices.

use super::window::{TAPS, taps};
use super::{C1, C2, Target};
use burn::tensor::{Int, Tensor, TensorData};

/// See [`super::picture_loss`].
pub fn picture_loss(picture: Tensor<2>, target: &Target) -> Tensor<1> {
    let device = picture.device();
    let [width, height] = target.size();
    let area = width * height;
    let floats = |values: Vec<f32>, shape: [usize; 2]| {
        Tensor::<2>::from_data(TensorData::new(values, shape), &device)
    };
    let inside: Vec<i64> = target.pixels().map(|pixel| pixel as i64).collect();
    let inside = Tensor::<1, Int>::from_data(TensorData::new(inside, [area]), &device);
    let truth: Vec<f32> = target.rgb.iter().map(|v| f32::from(*v) / 255.0).collect();
    let truth = floats(truth, [target.width * target.height, 3]);
    let image = |pixels: Tensor<2>| {
        let pixels = pixels.select(0, inside.clone());
        pixels.transpose().reshape([3, height, width])
    };
    let (seen, truth) = (image(picture.clone().narrow(1, 0, 3)), image(truth));

    let band = |side: usize| {
        let mut matrix = vec![0f32; side * side];
        for (i, tap) in taps().into_iter().enumerate() {
            for row in 0..side {
                let column = (row + i).wrapping_sub(TAPS / 2);
                if column < side {
                    matrix[row * side + column] = tap;
                }
            }
        }
        floats(matrix, [side, side]).unsqueeze::<3>()
    };
    let (down, across) = (band(height), band(width));
    let blur = |image: Tensor<3>| down.clone().matmul(image).matmul(across.clone());
    let (a, b) = (blur(seen.clone()), blur(truth.clone()));
    let (aa, bb, ab) = (a.clone() * a.clone(), b.clone() * b.clone(), a * b);
    let variance = blur(seen.clone() * seen.clone()) - aa.clone();
    let true_variance = blur(truth.clone() * truth.clone()) - bb.clone();
    let covariance = blur(seen.clone() * truth.clone()) - ab.clone();
    // SSIM = (2 μₐ μ_b + C₁) (2 σₐ_b + C₂) / ((μₐ² + μ_b² + C₁) (σₐ² + σ_b² + C₂))
    let luminance = (ab * 2.0 + C1) / (aa + bb + C1);
    let structure = (covariance * 2.0 + C2) / (variance + true_variance + C2);
    let dissimilarity = (luminance * structure).mean().neg() + 1.0;
    let absolute = (seen - truth).abs().mean();

    let column = |of: &dyn Fn(f32) -> f32| {
        let values: Vec<f32> = target
            .mask
            .iter()
            .map(|m| of(f32::from(*m) / 255.0))
            .collect();
        floats(values, [target.width * target.height, 1])
    };
    let difference = picture.narrow(1, 3, 1) - column(&|m| m);
    let confidence = column(&|m| (2.0 * m - 1.0).abs());
    let mask_error = (difference.clone() * difference * confidence).sum() / area as f32;
    let weights = target.weights;
    let total = absolute.clone() * weights.absolute
        + dissimilarity.clone() * weights.ssim
        + mask_error.clone() * weights.mask;
    let terms = [absolute, dissimilarity, mask_error].map(Tensor::detach);
    Tensor::cat([vec![total], terms.to_vec()].concat(), 0)
}
