//! The loss on CPU threads. One pass computes value and gradient, since they share most of the work.

use super::window::blur;
use super::{C1, C2, PictureLossOps, Target};
use crate::flex::tensor;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Flex, TensorMetadata};
use rayon::prelude::*;

impl PictureLossOps for Flex {
    fn picture_loss(
        picture: FloatTensor<Self>,
        target: Target,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        let shape: [usize; 2] = picture.shape().dims();
        let picture = picture.to_contiguous();
        let (terms, gradient) = compare(picture.storage(), &target);
        (tensor(terms.to_vec(), [4]), tensor(gradient, shape))
    }

    fn picture_loss_backward(
        gradient: FloatTensor<Self>,
        grad: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let shape: [usize; 2] = gradient.shape().dims();
        let (gradient, grad) = (gradient.to_contiguous(), grad.to_contiguous());
        let [factor, ..] = grad.storage::<f32>() else {
            unreachable!("the gradient to four numbers is empty")
        };
        let scaled = gradient
            .storage::<f32>()
            .iter()
            .map(|s| s * factor)
            .collect();
        tensor(scaled, shape)
    }
}

/// One channel of the region: the sums of absolute differences and of SSIM, and the gradient of the weighted
/// loss.
struct Channel {
    absolute: f64,
    ssim: f64,
    gradient: Vec<f32>,
}

/// The numbers of [`super::picture_loss`], and the gradient of the first with respect to the picture.
fn compare(picture: &[f32], target: &Target) -> ([f32; 4], Vec<f32>) {
    let picture = picture.as_chunks::<4>().0;
    let mut gradient = vec![0f32; 4 * picture.len()];
    let gradients = gradient.as_chunks_mut::<4>().0;
    let [width, height] = target.size();
    let area = (width * height) as f32;
    let channels: Vec<Channel> = (0..3usize)
        .into_par_iter()
        .map(|c| channel(picture, target, c))
        .collect();
    for (c, channel) in channels.iter().enumerate() {
        for (pixel, to) in target.pixels().zip(&channel.gradient) {
            gradients[pixel][c] = *to;
        }
    }
    let mut mask_error = 0f64;
    for ((pixel, to), mask) in picture.iter().zip(gradients).zip(target.mask.iter()) {
        // w (α − m)² with w = |2 m − 1|
        let coverage = f32::from(*mask) / 255.0;
        let confidence = (2.0 * coverage - 1.0).abs();
        let difference = pixel[3] - coverage;
        mask_error += f64::from(confidence * difference * difference);
        to[3] = target.weights.mask * 2.0 * confidence * difference / area;
    }
    let values = f64::from(3.0 * area);
    let absolute = channels.iter().map(|channel| channel.absolute).sum::<f64>() / values;
    let dissimilarity = 1.0 - channels.iter().map(|channel| channel.ssim).sum::<f64>() / values;
    let mask_error = mask_error / f64::from(area);
    let weights = target.weights;
    let total = f64::from(weights.absolute) * absolute
        + f64::from(weights.ssim) * dissimilarity
        + f64::from(weights.mask) * mask_error;
    (
        [total, absolute, dissimilarity, mask_error].map(|v| v as f32),
        gradient,
    )
}

fn channel(picture: &[[f32; 4]], target: &Target, c: usize) -> Channel {
    let [width, height] = target.size();
    let seen: Vec<f32> = target.pixels().map(|pixel| picture[pixel][c]).collect();
    let truth: Vec<f32> = target
        .pixels()
        .map(|pixel| f32::from(target.rgb[3 * pixel + c]) / 255.0)
        .collect();
    let share = 1.0 / (3 * width * height) as f32;
    let (ssim, to_seen) = similarity(&seen, &truth, width, height);
    let mut absolute = 0f64;
    let gradient = seen.iter().zip(&truth).zip(to_seen);
    let gradient = gradient.map(|((seen, truth), to_seen)| {
        let difference = seen - truth;
        absolute += f64::from(difference.abs());
        // The derivative of |d|, and 0 at d = 0.
        let sign = if difference == 0.0 {
            0.0
        } else {
            difference.signum()
        };
        share * (target.weights.absolute * sign - target.weights.ssim * to_seen)
    });
    let gradient = gradient.collect();
    Channel {
        absolute,
        ssim,
        gradient,
    }
}

/// The sum of SSIM over all pixels, and its gradient with respect to `seen`.
///
/// With a = seen, b = truth and means under the window: SSIM = l s, where l = (2 μₐ μ_b + C₁) / (μₐ² + μ_b² + C₁)
/// compares luminance and s = (2 σₐ_b + C₂) / (σₐ² + σ_b² + C₂) contrast and structure.
fn similarity(seen: &[f32], truth: &[f32], width: usize, height: usize) -> (f64, Vec<f32>) {
    let products = |a: &[f32], b: &[f32]| -> Vec<f32> {
        let product: Vec<f32> = a.iter().zip(b).map(|(a, b)| a * b).collect();
        blur(&product, width, height)
    };
    let (mean, true_mean) = (blur(seen, width, height), blur(truth, width, height));
    let (square, true_square) = (products(seen, seen), products(truth, truth));
    let product = products(seen, truth);
    let n = seen.len();
    let mut sum = 0f64;
    // Gradients to the mean μₐ, the mean square and the mean product.
    let (mut to_mean, mut to_square, mut to_product) =
        (vec![0f32; n], vec![0f32; n], vec![0f32; n]);
    for i in 0..n {
        let (a, b) = (mean[i], true_mean[i]);
        // σₐ² = E[a²] − μₐ², σₐ_b = E[a b] − μₐ μ_b
        let (variance, true_variance) = (square[i] - a * a, true_square[i] - b * b);
        let covariance = product[i] - a * b;
        let luminance = (2.0 * a * b + C1) / (a * a + b * b + C1);
        let variances = variance + true_variance + C2;
        let structure = (2.0 * covariance + C2) / variances;
        sum += f64::from(luminance * structure);
        // ∂SSIM/∂σₐ_b = 2 l / (σₐ² + σ_b² + C₂), ∂SSIM/∂σₐ² = −l s / (σₐ² + σ_b² + C₂),
        // ∂l/∂μₐ = 2 (μ_b − l μₐ) / (μₐ² + μ_b² + C₁)
        let to_covariance = 2.0 * luminance / variances;
        let to_variance = -luminance * structure / variances;
        let to_luminance = 2.0 * (b - luminance * a) / (a * a + b * b + C1);
        to_square[i] = to_variance;
        to_product[i] = to_covariance;
        to_mean[i] = structure * to_luminance - 2.0 * a * to_variance - b * to_covariance;
    }
    // The window is symmetric, so the gradient of a mean under it is a mean under it.
    let [by_mean, by_square, by_product] =
        [to_mean, to_square, to_product].map(|gradient| blur(&gradient, width, height));
    let gradient = (0..n)
        .map(|i| by_mean[i] + 2.0 * seen[i] * by_square[i] + truth[i] * by_product[i])
        .collect();
    (sum, gradient)
}
