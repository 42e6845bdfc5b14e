//! Validation on held-out frames.

use super::{TrainError, Trainer};
use crate::evaluate::score::{EQUAL, unit};
use crate::evaluate::{psnr, ssim};
use crate::render::RenderView;

/// Number of held-out frames per person that are rendered.
const FRAMES: usize = 2;

impl Trainer {
    /// Renders held-out frames and sets PSNR and SSIM of the progress to their means. Where poses
    /// are refined, those of held-out frames change as their neighbours' do, without a look at their
    /// pictures. Training time does not include this.
    ///
    /// # Errors
    /// If the device fails.
    pub fn validate(&mut self) -> Result<(), TrainError> {
        let renderer = self.renderer();
        let refined = self.config.refinement.takes_part(self.opened());
        let (mut psnr_sum, mut ssim_sum, mut images) = (0.0, Some(0.0), 0usize);
        for subject in &self.subjects {
            for frame in subject.held_out.iter().take(FRAMES) {
                let pose = match &self.state.poses[subject.slot] {
                    Some(poses) if refined => poses.as_neighbours(frame.place, &frame.pose),
                    _ => frame.pose.clone(),
                };
                let view = RenderView {
                    slot: subject.slot,
                    pose,
                    camera: frame.camera.clone(),
                    background: [0.0; 3],
                };
                let rendered = renderer.render(&view)?;
                let truth = unit(&frame.image.rgb);
                psnr_sum += psnr(&rendered.rgb, &truth).min(EQUAL);
                let similarity = ssim(&rendered.rgb, &truth, rendered.width, rendered.height);
                ssim_sum = ssim_sum.zip(similarity).map(|(sum, one)| sum + one);
                images += 1;
            }
        }
        if images > 0 {
            self.progress.psnr = Some(psnr_sum / images as f64);
            self.progress.ssim = ssim_sum.map(|sum| sum / images as f64);
        }
        Ok(())
    }
}
