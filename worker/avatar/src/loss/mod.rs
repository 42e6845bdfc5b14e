//! Training objectives. With LPIPS weights, [`PatchObjective`] is the paper's: LPIPS plus 0.2 times
//! the mean squared error. Without them, it is the mean squared error plus a weighted 1 − SSIM.
//! Reports name the objective beside their figures. A trainer accepts any other [`Objective`].

pub mod lpips;
mod ssim;

pub use ssim::PatchSsim;

use burn::tensor::{Device, Tensor};
use lpips::{Lpips, LpipsError, LpipsWeights, SMALLEST_SIDE};

/// Weight of the mean squared error beside LPIPS (HumanNeRF, `configs/default.yaml`; the paper
/// keeps it).
const SQUARES_BESIDE_LPIPS: f64 = 0.2;

/// Rendered patches and their ground truth.
#[derive(Clone)]
pub struct Patches {
    /// `[P, S², 3]`, rendered, over the step's background.
    pub predicted: Tensor<3>,
    /// `[P, S², 3]`, over the same background.
    pub truth: Tensor<3>,
    /// S: side length of a patch, pixels.
    pub side: usize,
}

/// One part of an objective.
pub struct LossTerm {
    /// Its name in reports.
    pub name: &'static str,
    /// Its weight in the sum.
    pub weight: f64,
    /// `[1]`, unweighted.
    pub value: Tensor<1>,
}

/// Training objective: a weighted sum of terms.
pub trait Objective: Send {
    /// Its name in reports, e.g. "lpips+mse".
    fn name(&self) -> &'static str;

    /// The terms for the patches of a training step; at least one.
    fn terms(&self, patches: Patches) -> Vec<LossTerm>;

    /// The weighted sum of the terms, `[1]`; `None` if there are no terms.
    fn loss(&self, patches: Patches) -> Option<Tensor<1>> {
        total(&self.terms(patches))
    }
}

/// The weighted sum of `terms`, `[1]`; `None` without terms.
pub(crate) fn total(terms: &[LossTerm]) -> Option<Tensor<1>> {
    terms
        .iter()
        .map(|term| match term.weight == 1.0 {
            true => term.value.clone(),
            false => term.value.clone() * term.weight,
        })
        .reduce(|sum, term| sum + term)
}

/// The objective of the paper, or a substitute without LPIPS weights.
pub struct PatchObjective {
    patch_size: usize,
    part: Perceptual,
}

/// The term beside the mean squared error.
enum Perceptual {
    Lpips(Box<Lpips>),
    Ssim { ssim: Box<PatchSsim>, weight: f64 },
    None,
}

impl PatchObjective {
    /// The paper's when there are LPIPS weights and patches are at least
    /// [`SMALLEST_SIDE`] pixels; else [`Self::without_lpips`]. Tiers with smaller patches are
    /// made for speed, and VGG is slow: the weights are not used for them, and the log says so.
    ///
    /// # Errors
    /// When the weights can't be used, for small patches too.
    pub fn with_weights(
        weights: Option<&LpipsWeights>,
        ssim_weight: f64,
        patch_size: usize,
        device: &Device,
    ) -> Result<Self, LpipsError> {
        let lpips = weights
            .map(|weights| Lpips::load(weights, device))
            .transpose()?;
        Ok(Self::new(lpips, ssim_weight, patch_size, device))
    }

    /// [`Self::with_weights`] with the networks at hand.
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

    /// Mean squared error, plus 1 − SSIM with `ssim_weight` if patches have at least the size of
    /// its window.
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

impl Objective for PatchObjective {
    fn name(&self) -> &'static str {
        match self.part {
            Perceptual::Lpips(_) => "lpips+mse",
            Perceptual::Ssim { .. } => "mse+ssim",
            Perceptual::None => "mse",
        }
    }

    /// Each term is a mean over patches.
    fn terms(&self, patches: Patches) -> Vec<LossTerm> {
        let Patches {
            predicted, truth, ..
        } = patches;
        let term = |name, weight, value| LossTerm {
            name,
            weight,
            value,
        };
        let squares = (predicted.clone() - truth.clone()).square().mean();
        match &self.part {
            Perceptual::Lpips(lpips) => {
                let distances = lpips.distance(self.images(predicted), self.images(truth));
                vec![
                    term("lpips", 1.0, distances.mean()),
                    term("mse", SQUARES_BESIDE_LPIPS, squares),
                ]
            }
            Perceptual::Ssim { ssim, weight } => {
                let distance = ssim.mean(predicted, truth).neg() + 1.0;
                vec![term("mse", 1.0, squares), term("1-ssim", *weight, distance)]
            }
            Perceptual::None => vec![term("mse", 1.0, squares)],
        }
    }
}
