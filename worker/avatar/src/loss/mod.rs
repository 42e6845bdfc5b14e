//! What training makes small. With LPIPS weights, the paper's: LPIPS and a fifth of the mean
//! squared error. Without them, the mean squared error and a share of 1 − SSIM. Which one it
//! is has a name, and the name goes where the figures go.

pub mod lpips;
mod ssim;

pub use ssim::PatchSsim;

use burn::tensor::{Device, Tensor};
use lpips::{Lpips, LpipsError, SMALLEST_SIDE};

/// The mean squared error's weight beside LPIPS (model.md §8).
const SQUARES_BESIDE_LPIPS: f64 = 0.2;

/// The objective of a training.
pub struct Objective {
    patch_size: usize,
    part: Perceptual,
}

/// What stands beside the mean squared error.
enum Perceptual {
    Lpips(Box<Lpips>),
    Ssim { ssim: Box<PatchSsim>, weight: f64 },
    None,
}

impl Objective {
    /// The paper's when the environment names LPIPS weights and patches are at least
    /// [`SMALLEST_SIDE`] pixels; else [`Self::without_lpips`]. Tiers with smaller patches are
    /// made for speed, which VGG would take: for them the weights are left aside, and the log
    /// says so.
    ///
    /// # Errors
    /// When weights are named and can't be used, for small patches too.
    pub fn from_environment(
        ssim_weight: f64,
        patch_size: usize,
        device: &Device,
    ) -> Result<Self, LpipsError> {
        let lpips = Lpips::from_environment(device)?;
        Ok(Self::new(lpips, ssim_weight, patch_size, device))
    }

    /// [`Self::from_environment`] with the weights at hand.
    pub fn new(lpips: Option<Lpips>, ssim_weight: f64, patch_size: usize, device: &Device) -> Self {
        match lpips {
            Some(lpips) if patch_size >= SMALLEST_SIDE => Self {
                patch_size,
                part: Perceptual::Lpips(Box::new(lpips)),
            },
            given => {
                let objective = Self::without_lpips(ssim_weight, patch_size, device);
                if given.is_some() {
                    tracing::warn!(
                        patch_size,
                        needed = SMALLEST_SIDE,
                        objective = objective.name(),
                        "patches are too small for LPIPS: trained without it"
                    );
                }
                objective
            }
        }
    }

    /// Mean squared error, and 1 − SSIM at `ssim_weight` when patches are at least its window.
    pub fn without_lpips(ssim_weight: f64, patch_size: usize, device: &Device) -> Self {
        let ssim = PatchSsim::new(patch_size, device).filter(|_| ssim_weight > 0.0);
        let part = match ssim {
            Some(ssim) => Perceptual::Ssim {
                ssim: Box::new(ssim),
                weight: ssim_weight,
            },
            None => Perceptual::None,
        };
        Self { patch_size, part }
    }

    /// What reports call it.
    pub fn name(&self) -> &'static str {
        match self.part {
            Perceptual::Lpips(_) => "lpips+mse",
            Perceptual::Ssim { .. } => "mse+ssim",
            Perceptual::None => "mse",
        }
    }

    /// `predicted` and `truth` `[P, S², 3]` → `[1]`, a mean over patches.
    pub fn loss(&self, predicted: Tensor<3>, truth: Tensor<3>) -> Tensor<1> {
        let squares = (predicted.clone() - truth.clone()).square().mean();
        match &self.part {
            Perceptual::Lpips(lpips) => {
                let distances = lpips.distance(self.images(predicted), self.images(truth));
                distances.mean() + squares * SQUARES_BESIDE_LPIPS
            }
            Perceptual::Ssim { ssim, weight } => {
                squares + (ssim.mean(predicted, truth).neg() + 1.0) * *weight
            }
            Perceptual::None => squares,
        }
    }

    /// Patches `[P, S², 3]` in [0, 1] → `[P, 3, S, S]` in [−1, 1].
    fn images(&self, patches: Tensor<3>) -> Tensor<4> {
        let [count, _, _] = patches.dims();
        let side = self.patch_size;
        patches
            .swap_dims(1, 2)
            .reshape([count, 3, side, side])
            .mul_scalar(2.0)
            .sub_scalar(1.0)
    }
}
