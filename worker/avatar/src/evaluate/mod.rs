//! How good a rendering is, measured against the truth.
//!
//! [`metrics`] and [`ssim`] compare two images; [`score`] gathers their figures over
//! pictures and people; [`examine`] renders what a picture shows and scores it by the rules
//! of a [`protocol`]; [`published`] holds what the paper reached, to stand beside ours.

pub mod examine;
pub mod lpips;
pub mod metrics;
pub mod protocol;
pub mod published;
pub mod score;
pub mod ssim;

pub use examine::{Examined, Examiner, Truth};
pub use lpips::LpipsMetric;
pub use metrics::{psnr, psnr_in_box};
pub use protocol::Protocol;
pub use score::{Mean, PictureScore, Score, compare};
pub use ssim::{ssim, ssim_inflated, ssim_uniform};

use crate::loss::lpips::LpipsError;
use crate::render::RenderError;
use thiserror::Error;

/// Why a picture can't be measured.
#[derive(Debug, Error)]
pub enum EvaluateError {
    /// The pictures differ in size.
    #[error("a render of {found:?} pixels for a picture of {expected:?}")]
    Size {
        /// Width and height of the truth.
        expected: (usize, usize),
        /// Of the render.
        found: (usize, usize),
    },
    /// SSIM's window does not fit.
    #[error("{0}x{1} pixels: both sides must be at least 11, the window of SSIM")]
    TooSmall(usize, usize),
    /// The model can't render it.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// LPIPS can't be measured.
    #[error(transparent)]
    Lpips(#[from] LpipsError),
}
