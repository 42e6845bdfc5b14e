//! What training makes small: the mean squared error of patches, and a share of 1 − SSIM.

mod ssim;

pub use ssim::PatchSsim;

use burn::tensor::Tensor;

/// The objective of a training, by name and weights.
pub struct Objective {
    ssim: Option<PatchSsim>,
    ssim_weight: f64,
}

impl Objective {
    /// Mean squared error, and SSIM at `ssim_weight` when patches are at least its window.
    pub fn new(ssim_weight: f64, patch_size: usize, device: &burn::tensor::Device) -> Self {
        let ssim = if ssim_weight > 0.0 {
            PatchSsim::new(patch_size, device)
        } else {
            None
        };
        Self { ssim, ssim_weight }
    }

    /// What reports call it.
    pub fn name(&self) -> &'static str {
        if self.ssim.is_some() {
            "mse+ssim"
        } else {
            "mse"
        }
    }

    /// `predicted` and `truth` `[P, S², 3]` → `[1]`.
    pub fn loss(&self, predicted: Tensor<3>, truth: Tensor<3>) -> Tensor<1> {
        let error = (predicted.clone() - truth.clone()).square().mean();
        match &self.ssim {
            Some(ssim) => error + (ssim.mean(predicted, truth).neg() + 1.0) * self.ssim_weight,
            None => error,
        }
    }
}
