//! Validation on held-out frames.

use crate::evaluate::score::{EQUAL, unit};
use crate::evaluate::{psnr, psnr_in_box, ssim};
use crate::render::{RenderView, Renderer};
use crate::train::model::Model;
use crate::train::people::TrainSubject;
use crate::train::{TrainError, exposure};
use yoto_capture::mask_box;

/// Most held-out frames per person that are rendered: those that take milliseconds, and those that take
/// seconds. The best checkpoint is chosen by them.
const FAST_FRAMES: usize = 16;
const SLOW_FRAMES: usize = 4;
/// Fewest per person, whatever the number of people.
const FEWEST: usize = 2;
/// Most people whose frames are all rendered; beyond it, each has fewer.
const PEOPLE: usize = 6;

/// Number of held-out frames per person that are rendered for a model of `people`.
fn frames_per_person(fast: bool, people: usize) -> usize {
    let most = match fast {
        true => FAST_FRAMES,
        false => SLOW_FRAMES,
    };
    (most * PEOPLE / people.max(PEOPLE)).max(FEWEST)
}

/// `count` of the `held_out` frames, evenly spread, in order.
fn spread<T>(held_out: &[T], count: usize) -> impl Iterator<Item = &T> {
    let count = count.min(held_out.len());
    (0..count).map(move |index| &held_out[index * held_out.len() / count])
}

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

/// Renders held-out frames of the `subjects` and compares them. `on_batch` is called before each batch of rays.
pub(crate) fn validate(
    renderer: &Renderer,
    model: &Model,
    subjects: &[TrainSubject],
    schedule_progress: f64,
    on_batch: &mut dyn FnMut(),
) -> Result<Measured, TrainError> {
    let refined = model.config.refinement.takes_part(schedule_progress);
    let (mut psnr_sum, mut ssim_sum, mut images) = (0.0, Some(0.0), 0usize);
    let (mut box_sum, mut boxes) = (0.0, 0usize);
    let mut previews = Vec::new();
    let fast = model.config.appearance.capabilities().fast_frames;
    let count = frames_per_person(fast, subjects.len());
    for subject in subjects {
        for (position, frame) in spread(&subject.held_out, count).enumerate() {
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
                on_batch();
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

#[cfg(test)]
mod tests {
    use super::{frames_per_person, spread};

    #[test]
    fn measured_frames_are_spread_over_those_held_out() {
        let held_out: Vec<usize> = (0..10).collect();
        let chosen = |count| spread(&held_out, count).copied().collect::<Vec<_>>();
        assert_eq!(chosen(4), [0, 2, 5, 7]);
        assert_eq!(chosen(40), held_out);
        assert_eq!(spread(&[] as &[usize], 4).count(), 0);
    }

    #[test]
    fn many_people_have_fewer_frames_each() {
        let of_splats = [1, 6, 12, 1000].map(|people| frames_per_person(true, people));
        assert_eq!(of_splats, [16, 16, 8, 2]);
        assert_eq!(frames_per_person(false, 1), 4);
    }
}
