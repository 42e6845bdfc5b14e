//! What was made of a clip, in figures.

use super::capture::{Captured, Checked};
use super::{AvatarOptions, LARGEST, PERSON, summary};
use crate::studio::shots::Finished;
use serde::Serialize;
use std::path::{Path, PathBuf};
use yoto_capture::check::{Cause, Lack, Measure};
use yoto_proto::v1::TrainResult;

/// Where in the clip the pose of the orbit is, as a share of its frames: people stand at ease in
/// the middle rather than while they walk in or out.
const ORBIT_MOMENT: f64 = 0.4;

/// What was made of a clip.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct AvatarReport {
    /// Name of the person.
    pub name: String,
    /// Frames with the person, and the pictures' width and height in pixels.
    pub frames: usize,
    /// Width and height of the clip, pixels.
    pub image_size: [u32; 2],
    /// Frames per second of the clip.
    pub fps: f64,
    /// What the import assumed and found.
    pub notes: Vec<String>,
    /// The check's measures.
    pub check: Vec<Measure>,
    /// Mistakes that would explain what is wrong.
    pub causes: Vec<Cause>,
    /// What the clip lacks, and what the next one should do instead.
    pub lacks: Vec<Lack>,
    /// The frame whose pose the orbit shows.
    pub orbit_frame: u32,
    /// Longest side of training images and renders, pixels.
    pub size: u32,
    /// The training; absent before it.
    pub training: Option<Training>,
    /// Pictures of the orbit, in order, relative to the report.
    pub orbit: Vec<PathBuf>,
    /// Pictures of the motion.
    pub motion: Vec<PathBuf>,
    /// How long everything took.
    pub seconds: Seconds,
}

/// A training in figures.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Training {
    /// Steps.
    pub steps: u64,
    /// PSNR on held-out frames of the clip within the person's box, dB.
    pub psnr_box: Option<f64>,
    /// PSNR on these frames over whole pictures, dB.
    pub psnr: Option<f64>,
    /// Number of those frames.
    pub held_out: u32,
    /// Share of the surface that no frame shows, whose colours are guessed, 0 to 1; absent if nothing is.
    pub guessed: Option<f64>,
    /// Weights of the model.
    pub parameters: u64,
    /// Where it was computed.
    pub device: String,
    /// Refined poses, frames that are left out.
    pub notes: Vec<String>,
}

/// Seconds of each part.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub(crate) struct Seconds {
    /// Reading the clip and its poses.
    pub import: f64,
    /// The check.
    pub check: f64,
    /// Training.
    pub training: f64,
    /// One rendered picture.
    pub per_picture: f64,
    /// Everything.
    pub total: f64,
}

/// Longest side of training images and renders, pixels, for a clip whose longest side has `longest` pixels, of which the
/// person takes the share `person`. The person is [`PERSON`] pixels long where the clip has them.
fn default_size(longest: u32, person: f64) -> u32 {
    let wanted = (f64::from(PERSON) / person).round() as u32;
    longest.min(wanted).min(LARGEST)
}

impl AvatarReport {
    pub(super) fn new(options: &AvatarOptions, captured: Captured, checked: Checked) -> Self {
        let [width, height] = captured.image_size;
        let moment = (ORBIT_MOMENT * captured.frames.len() as f64) as usize;
        Self {
            name: options.name.clone(),
            frames: captured.frames.len(),
            image_size: captured.image_size,
            fps: captured.fps,
            lacks: summary::lacks(&captured, &checked),
            notes: captured.notes,
            check: checked.report.measures,
            causes: checked.report.causes,
            orbit_frame: captured.frames.get(moment).copied().unwrap_or_default(),
            size: options
                .size
                .unwrap_or_else(|| default_size(width.max(height), captured.person)),
            training: None,
            orbit: Vec::new(),
            motion: Vec::new(),
            seconds: Seconds {
                import: captured.seconds,
                check: checked.seconds,
                ..Seconds::default()
            },
        }
    }

    pub(super) fn trained(&mut self, result: TrainResult) {
        self.seconds.training = result.train_seconds;
        self.training = Some(Training {
            steps: result.steps,
            psnr_box: result.psnr_mask_box,
            psnr: result.psnr,
            held_out: result.held_out,
            guessed: result.guessed,
            parameters: result.parameters,
            device: result.device,
            notes: result.notes,
        });
    }

    pub(super) fn rendered(&mut self, out: &Path, orbit: &Finished, motion: &Finished) {
        let relative = |path: &PathBuf| path.strip_prefix(out).unwrap_or(path).to_owned();
        self.orbit = orbit.frames.iter().map(relative).collect();
        self.motion = motion.frames.iter().map(relative).collect();
        let pictures = (orbit.frames.len() + motion.frames.len()).max(1) as f64;
        let seconds = orbit.seconds_per_frame * orbit.frames.len() as f64
            + motion.seconds_per_frame * motion.frames.len() as f64;
        self.seconds.per_picture = seconds / pictures;
    }
}

#[cfg(test)]
mod tests {
    use super::default_size;

    #[test]
    fn a_small_person_in_a_large_picture_keeps_their_pixels() {
        assert_eq!(default_size(1920, 1.0), 512);
        assert_eq!(default_size(1280, 0.55), 931);
        assert_eq!(default_size(1920, 0.2), 1024);
        assert_eq!(default_size(300, 0.5), 300, "no more than the clip has");
    }
}
