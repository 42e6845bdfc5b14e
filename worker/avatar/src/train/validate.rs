//! Validation on held-out frames.

use super::{TrainError, Trainer};
use crate::evaluate::score::{EQUAL, unit};
use crate::evaluate::{psnr, psnr_in_box, ssim};
use crate::render::RenderView;
use yoto_capture::mask_box;

/// Number of held-out frames per person that are rendered.
const FRAMES: usize = 2;

/// A held-out frame beside its render.
#[derive(Clone, Debug)]
pub struct Preview {
    /// Slot of the person.
    pub slot: usize,
    /// Width of both, pixels.
    pub width: usize,
    /// Height of both, pixels.
    pub height: usize,
    /// The frame over black, `[H, W, 3]`.
    pub truth: Vec<u8>,
    /// The render, `[H, W, 3]`.
    pub render: Vec<u8>,
}

impl Trainer {
    /// The first held-out frame of each person that has one, as the last [validation] rendered it;
    /// none before the first validation.
    ///
    /// [validation]: Self::validate
    pub fn previews(&self) -> &[Preview] {
        &self.previews
    }

    /// Renders held-out frames and sets PSNR and SSIM of the progress to their means. Where poses
    /// are refined, those of held-out frames change as their neighbours' do, without a look at their
    /// pictures; their exposures lie between those of their neighbours. Training time does not include this.
    ///
    /// # Errors
    /// If the device fails.
    pub fn validate(&mut self) -> Result<(), TrainError> {
        self.validate_with(&mut || {})
    }

    /// The same; `goes_on` is called before each batch of rays, since a frame of the paper's tiers takes
    /// most of a minute.
    ///
    /// # Errors
    /// If the device fails.
    pub fn validate_with(&mut self, goes_on: &mut dyn FnMut()) -> Result<(), TrainError> {
        let renderer = self.renderer();
        let refined = self.config.refinement.takes_part(self.opened());
        let (mut psnr_sum, mut ssim_sum, mut images) = (0.0, Some(0.0), 0usize);
        let (mut box_sum, mut boxes) = (0.0, 0usize);
        let mut previews = Vec::new();
        for subject in &self.subjects {
            for (place, frame) in subject.held_out.iter().take(FRAMES).enumerate() {
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
                let mut rendered = renderer.render_scene(&view.into(), &mut |_| {
                    goes_on();
                    true
                })?;
                let index = subject.track.frames[frame.place].index;
                (self.exposure_near(subject.slot, index)).expose(&mut rendered);
                let image = subject.image(frame);
                let truth = unit(&image.rgb);
                psnr_sum += psnr(&rendered.rgb, &truth).min(EQUAL);
                let similarity = ssim(&rendered.rgb, &truth, rendered.width, rendered.height);
                ssim_sum = ssim_sum.zip(similarity).map(|(sum, one)| sum + one);
                images += 1;
                let (width, height) = (rendered.width, rendered.height);
                if let Some(region) = mask_box(&image.mask, width, height) {
                    box_sum += psnr_in_box(&rendered.rgb, &truth, width, &region).min(EQUAL);
                    boxes += 1;
                }
                if place == 0 {
                    previews.push(Preview {
                        slot: subject.slot,
                        width,
                        height,
                        truth: image.rgb,
                        render: rendered.to_rgb8(),
                    });
                }
            }
        }
        self.previews = previews;
        self.progress.held_out = images as u32;
        self.progress.psnr_mask_box = (boxes > 0).then(|| box_sum / boxes as f64);
        if images > 0 {
            self.progress.psnr = Some(psnr_sum / images as f64);
            self.progress.ssim = ssim_sum.map(|sum| sum / images as f64);
        }
        Ok(())
    }
}
