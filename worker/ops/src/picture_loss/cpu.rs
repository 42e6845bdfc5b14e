//! The comparison on CPU threads. Value and gradient come from one pass, since they share most of it.

use super::window::blur;
use super::{C1, C2, PictureLossOps, Target};
use crate::flex::tensor;
use burn::backend::{Flex, TensorMetadata, tensor::FloatTensor};
use rayon::prelude::*;

impl PictureLossOps for Flex {
    fn picture_loss(
        picture: FloatTensor<Self>,
        target: Target,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        let shape: [usize; 2] = picture.shape().dims();
        let picture = picture.to_contiguous();
        let (terms, slope) = compare(picture.storage(), &target);
        (tensor(terms.to_vec(), [4]), tensor(slope, shape))
    }

    fn picture_loss_backward(
        slope: FloatTensor<Self>,
        grad: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let shape: [usize; 2] = slope.shape().dims();
        let (slope, grad) = (slope.to_contiguous(), grad.to_contiguous());
        let [factor, ..] = grad.storage::<f32>() else {
            unreachable!("the gradient to four numbers is empty")
        };
        let scaled = slope.storage::<f32>().iter().map(|s| s * factor).collect();
        tensor(scaled, shape)
    }
}

/// One channel of the region: its sums of absolute differences and SSIM, and the slope of the weighted
/// loss.
struct Channel {
    absolute: f64,
    ssim: f64,
    slope: Vec<f32>,
}

/// The numbers of [`super::picture_loss`], and the slope of the first to the picture.
fn compare(picture: &[f32], target: &Target) -> ([f32; 4], Vec<f32>) {
    let picture = picture.as_chunks::<4>().0;
    let mut slope = vec![0f32; 4 * picture.len()];
    let slopes = slope.as_chunks_mut::<4>().0;
    let [width, height] = target.size();
    let area = (width * height) as f32;
    let channels: Vec<Channel> = (0..3usize)
        .into_par_iter()
        .map(|c| channel(picture, target, c))
        .collect();
    for (c, channel) in channels.iter().enumerate() {
        for (pixel, to) in target.pixels().zip(&channel.slope) {
            slopes[pixel][c] = *to;
        }
    }
    let mut off_mask = 0f64;
    for ((pixel, to), mask) in picture.iter().zip(slopes).zip(target.mask.iter()) {
        let coverage = f32::from(*mask) / 255.0;
        let trust = (2.0 * coverage - 1.0).abs();
        let off = pixel[3] - coverage;
        off_mask += f64::from(trust * off * off);
        to[3] = target.weights.mask * 2.0 * trust * off / area;
    }
    let values = f64::from(3.0 * area);
    let absolute = channels.iter().map(|it| it.absolute).sum::<f64>() / values;
    let unlike = 1.0 - channels.iter().map(|it| it.ssim).sum::<f64>() / values;
    let off_mask = off_mask / f64::from(area);
    let weights = target.weights;
    let total = f64::from(weights.absolute) * absolute
        + f64::from(weights.ssim) * unlike
        + f64::from(weights.mask) * off_mask;
    ([total, absolute, unlike, off_mask].map(|v| v as f32), slope)
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
    let slope = seen.iter().zip(&truth).zip(to_seen);
    let slope = slope.map(|((seen, truth), to_seen)| {
        let off = seen - truth;
        absolute += f64::from(off.abs());
        // The derivative of |off|, 0 where it has none.
        let sign = if off == 0.0 { 0.0 } else { off.signum() };
        share * (target.weights.absolute * sign - target.weights.ssim * to_seen)
    });
    let slope = slope.collect();
    Channel {
        absolute,
        ssim,
        slope,
    }
}

/// The sum of SSIM over all pixels, and its slope to `seen`.
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
    // Slopes to the mean, the mean square and the mean product.
    let (mut to_mean, mut to_square, mut to_product) =
        (vec![0f32; n], vec![0f32; n], vec![0f32; n]);
    for i in 0..n {
        let (a, b) = (mean[i], true_mean[i]);
        let (spread, true_spread) = (square[i] - a * a, true_square[i] - b * b);
        let together = product[i] - a * b;
        let bright = (2.0 * a * b + C1) / (a * a + b * b + C1);
        let even = spread + true_spread + C2;
        let structure = (2.0 * together + C2) / even;
        sum += f64::from(bright * structure);
        let to_together = 2.0 * bright / even;
        let to_spread = -bright * structure / even;
        let to_bright = 2.0 * (b - bright * a) / (a * a + b * b + C1);
        to_square[i] = to_spread;
        to_product[i] = to_together;
        to_mean[i] = structure * to_bright - 2.0 * a * to_spread - b * to_together;
    }
    let [by_mean, by_square, by_product] =
        [to_mean, to_square, to_product].map(|slope| blur(&slope, width, height));
    let slope = (0..n)
        .map(|i| by_mean[i] + 2.0 * seen[i] * by_square[i] + truth[i] * by_product[i])
        .collect();
    (sum, slope)
}
