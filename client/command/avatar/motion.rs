//! The motion that shows an avatar off, when the user has none: a synthetic person's, with raised
//! arms and turns that few videos have. It moves SMPL's joints; a person with others shows their own.

use anyhow::{Context, ensure};
use yoto_capture::skeleton::timing::{mean_fps, seconds};
use yoto_import::motion::{Motion, MotionFrame};
use yoto_proto::v1::render_spec::What;
use yoto_proto::v1::{MotionClip, MotionTransfer, Subject};
use yoto_synthetic::SyntheticPerson;

/// Frames of the program's own motion, and their rate.
const FRAMES: usize = 30;
const FPS: f64 = 12.0;
/// Seed of the program's own motion: each run makes the same one.
const SEED: u64 = 7;
/// Most frames of a user's motion that are rendered, and the animation's frame rate for them.
const MOST_FRAMES: usize = 120;

/// The motion that is shown.
pub(super) enum ShownMotion<'a> {
    /// The user's.
    Given(&'a Motion),
    /// This program's own.
    BuiltIn,
    /// The clip's own, by the numbers of its frames.
    Clip(Vec<u32>),
}

impl ShownMotion<'_> {
    /// The caption of its pictures.
    pub(super) fn caption(&self) -> &'static str {
        match self {
            Self::Clip(_) => "In the clip's own motion.",
            Self::Given(_) | Self::BuiltIn => "In a motion that the clip does not have.",
        }
    }

    /// What to render of `subject`, whose clip has `fps` frames per second, and the pictures' frames per
    /// second.
    pub(super) fn what(
        &self,
        subject: &Subject,
        size: u32,
        fps: f64,
    ) -> anyhow::Result<(What, f32)> {
        let frames = match self {
            Self::Given(motion) => return clip(Some(motion), size).map(clip_of),
            Self::BuiltIn => return clip(None, size).map(clip_of),
            Self::Clip(frames) => frames,
        };
        let step = frames.len().div_ceil(MOST_FRAMES).max(1);
        let shown: Vec<u32> = frames.iter().copied().step_by(step).collect();
        let fps = mean_fps(&seconds(&shown, fps)).unwrap_or(fps);
        let transfer = MotionTransfer {
            driver: subject.name.clone(),
            frame_step: step as u32,
            size,
            follow: true,
            ..MotionTransfer::default()
        };
        Ok((What::Motion(transfer), fps.max(1.0) as f32))
    }
}

fn clip_of((clip, fps): (MotionClip, f32)) -> (What, f32) {
    (What::Clip(clip), fps)
}

/// The clip to render at `size`, and its frames per second.
fn clip(chosen: Option<&Motion>, size: u32) -> anyhow::Result<(MotionClip, f32)> {
    let own;
    let motion = match chosen {
        Some(motion) => motion,
        None => {
            own = built_in()?;
            &own
        }
    };
    ensure!(!motion.frames.is_empty(), "the motion has no frame");
    // Frames are left out evenly: a motion of 120 frames per second is shown at 15.
    let step = ((motion.fps / 15.0).floor() as usize).max(1);
    let end = MOST_FRAMES * step;
    if motion.frames.len() > end {
        detail!(
            "note: the motion has {} frames: the first {end} are rendered",
            motion.frames.len()
        );
    }
    let mut clip = motion.clip(0, end, step, size);
    clip.follow = true;
    Ok((clip, (motion.fps / step as f64) as f32))
}

fn built_in() -> anyhow::Result<Motion> {
    let cast = SyntheticPerson::cast(1, SEED);
    let person = cast.first().context("a cast of one person")?;
    let skeleton = person.skeleton();
    let rest = skeleton.rest_joints.first().copied().unwrap_or_default();
    let frames = person.motion(FRAMES);
    let frame = |pose: &yoto_capture::camera::Pose| MotionFrame {
        rotations: pose.rotations.iter().map(|r| r.map(f64::from)).collect(),
        root: std::array::from_fn(|axis| rest[axis] + f64::from(pose.translation[axis])),
    };
    Ok(Motion {
        frames: frames.iter().map(frame).collect(),
        skeleton,
        fps: FPS,
        matched: Vec::new(),
        unmatched: Vec::new(),
        notes: Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_own_motion_moves_and_a_fast_one_is_thinned() {
        let (clip, fps) = clip(None, 64).expect("a clip");
        assert_eq!((clip.poses.len(), clip.size, fps), (FRAMES, 64, 12.0));
        assert_ne!(clip.poses[0], clip.poses[FRAMES / 2]);

        let mut fast = built_in().expect("a motion");
        fast.fps = 120.0;
        fast.frames = fast.frames.iter().cycle().take(2000).cloned().collect();
        let (clip, fps) = super::clip(Some(&fast), 64).expect("a clip");
        assert_eq!((clip.poses.len(), fps), (MOST_FRAMES, 15.0));
    }
}
