//! Quality of renderings, measured against the ground truth.
//!
//! [`psnr`], [`ssim()`] and [`LpipsMetric`] compare two images; [`Mean`] and [`Score`] average their
//! figures over pictures and people; an [`Examiner`] renders the view of a picture and scores it by
//! the rules of a [`Protocol`]; [`paper_table()`] shows measured figures beside those of the paper.

mod examine;
mod lpips;
pub mod metrics;
mod paper_table;
pub mod protocol;
mod regions;
pub(crate) mod score;
mod splits;
mod ssim;

pub use examine::{Examined, Examiner, Truth};
pub use lpips::LpipsMetric;
pub use metrics::{psnr, psnr_in_box};
pub use paper_table::{Row, paper_table};
pub use protocol::Protocol;
pub use regions::{Region, RegionError, RegionSums};
pub use score::{Mean, PictureScore, Score, compare};
pub use splits::{SplitScores, SubjectScore, split_table};
pub use ssim::{ssim, ssim_inflated, ssim_uniform};

use crate::loss::lpips::LpipsError;
use crate::render::RenderError;
use thiserror::Error;

/// Evaluation error.
#[derive(Debug, Error)]
pub enum EvaluateError {
    /// Picture and render differ in size.
    #[error("a render of {found:?} pixels for a picture of {expected:?}")]
    Size {
        /// Width and height of the truth.
        expected: (usize, usize),
        /// Width and height of the render.
        found: (usize, usize),
    },
    /// The picture is smaller than the window of SSIM.
    #[error("{0}x{1} pixels: both sides must be at least 11, the window of SSIM")]
    TooSmall(usize, usize),
    /// The picture's view can't be rendered.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// LPIPS can't be measured.
    #[error(transparent)]
    Lpips(#[from] LpipsError),
}
