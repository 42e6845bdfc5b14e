//! Validation on held-out frames.

use crate::evaluate::score::{EQUAL, unit};
use crate::evaluate::{psnr, psnr_in_box, ssim};
use crate::render::{RenderView, Renderer};
use crate::train::model::Model;
use crate::train::people::TrainSubject;
use crate::train::{TrainError, exposure};
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

/// Means over the frames that were measured.
pub(crate) struct Measured {
    /// Number of frames.
    pub held_out: u32,
    /// dB; `None` without frames.
    pub psnr: Option<f64>,
    /// Within the box around the person, dB; `None` if no frame shows one.
    pub psnr_mask_box: Option<f64>,
    /// `None` if frames are smaller than its window.
    pub ssim: Option<f64>,
    /// The first frame of each person.
    pub previews: Vec<Preview>,
}

/// Renders held-out frames of the `subjects` and compares them. `goes_on` is called before each batch of rays.
pub(crate) fn validate(
    renderer: &Renderer,
    model: &Model,
    subjects: &[TrainSubject],
    opened: f64,
    goes_on: &mut dyn FnMut(),
) -> Result<Measured, TrainError> {
    let refined = model.config.refinement.takes_part(opened);
    let (mut psnr_sum, mut ssim_sum, mut images) = (0.0, Some(0.0), 0usize);
    let (mut box_sum, mut boxes) = (0.0, 0usize);
    let mut previews = Vec::new();
    for subject in subjects {
        for (position, frame) in subject.held_out.iter().take(FRAMES).enumerate() {
            let pose = match &model.state.poses[subject.slot] {
                Some(poses) if refined => poses.as_neighbours(frame.position, &frame.pose),
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
            let index = subject.track.frames[frame.position].index;
            exposure::near(&model.state.exposures, subject.slot, index).expose(&mut rendered);
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
            if position == 0 {
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
    Ok(Measured {
        held_out: images as u32,
        psnr: (images > 0).then(|| psnr_sum / images as f64),
        psnr_mask_box: (boxes > 0).then(|| box_sum / boxes as f64),
        ssim: ssim_sum.map(|sum| sum / images as f64),
        previews,
    })
}
