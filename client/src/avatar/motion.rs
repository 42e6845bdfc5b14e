//! The motion that shows an avatar off, when the user has none: a synthetic person's, with raised
//! arms and turns that few videos have.

use crate::import::motion::{Motion, MotionFrame};
use anyhow::{Context, ensure};
use yoto_capture::synthetic::SyntheticPerson;
use yoto_proto::v1::MotionClip;

/// Frames of the program's own motion, and how fast they are.
const FRAMES: usize = 30;
const FPS: f64 = 12.0;
/// The same motion at each run.
const SEED: u64 = 7;
/// Most frames of a user's motion that are rendered, and the animation's frame rate for them.
const MOST_FRAMES: usize = 120;

/// The clip to render at `size`, and its frames per second.
pub(super) fn clip(given: Option<&Motion>, size: u32) -> anyhow::Result<(MotionClip, f32)> {
    let own;
    let motion = match given {
        Some(motion) => motion,
        None => {
            own = built_in()?;
            &own
        }
    };
    ensure!(!motion.frames.is_empty(), "the motion has no frame");
    // Frames are left out evenly: a motion of 120 frames a second is told in 15.
    let step = ((motion.fps / 15.0).floor() as usize).max(1);
    let end = MOST_FRAMES * step;
    if motion.frames.len() > end {
        tell!(
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
