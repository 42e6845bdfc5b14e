//! How good a rendering is, measured against the truth.

pub mod metrics;

pub use metrics::{MaskBox, mask_box, psnr, psnr_in_box, ssim};
