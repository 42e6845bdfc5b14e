//! How training does on frames that it never sees.

use super::{TrainError, Trainer};
use crate::evaluate::{psnr, ssim};
use crate::render::RenderView;

/// Held-out frames a person that are rendered to see how training does.
const FRAMES: usize = 2;

impl Trainer {
    /// Renders held-out frames and notes PSNR and SSIM, means over the people. Its time is not
    /// training time.
    ///
    /// # Errors
    /// When the device fails.
    pub fn validate(&mut self) -> Result<(), TrainError> {
        let renderer = self.renderer();
        let (mut psnr_sum, mut ssim_sum, mut images) = (0.0, 0.0, 0usize);
        for subject in &self.subjects {
            for frame in subject.held_out.iter().take(FRAMES) {
                let view = RenderView {
                    slot: subject.slot,
                    pose: frame.pose.clone(),
                    camera: frame.camera.clone(),
                    background: [0.0; 3],
                };
                let rendered = renderer.render(&view)?;
                let truth: Vec<f32> = frame
                    .image
                    .rgb
                    .iter()
                    .map(|v| f32::from(*v) / 255.0)
                    .collect();
                psnr_sum += psnr(&rendered.rgb, &truth);
                ssim_sum += ssim(&rendered.rgb, &truth, rendered.width, rendered.height);
                images += 1;
            }
        }
        if images > 0 {
            self.progress.psnr = Some(psnr_sum / images as f64);
            self.progress.ssim = Some(ssim_sum / images as f64);
        }
        Ok(())
    }
}
