//! Motions, and random ones made of their parts.

use super::{Examples, normal};
use crate::rotation::{matmul, slerp};
use crate::skeleton::COUNT as JOINTS;
use rand::{Rng, RngExt};
use yoto_capture::skeleton::Vec3;
use yoto_capture::skeleton::transform::{Mat3, add, rodrigues, scale, sub};

/// Range of a motion's speed, as multiples of that of the clip.
const SPEED: [f64; 2] = [0.7, 1.4];
/// Share of the examples whose upper body moves as in another clip, and of those, whose left arm moves as in a third.
const MIXED: f64 = 0.5;
const MIXED_ARM: f64 = 0.3;
/// Joints above the waist, and those of the left arm.
const UPPER: [usize; 15] = [3, 6, 9, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23];
const LEFT_ARM: [usize; 5] = [13, 16, 18, 20, 22];
/// Standard deviation of a joint's rotation from the clip's, the same in all frames, radians.
const HABIT: f64 = 0.08;

/// A motion, facing +z in the rest pose, which is a T-pose.
#[derive(Clone, Debug)]
pub struct MotionClip {
    /// Frames per second.
    pub fps: f64,
    /// Frames in order.
    pub frames: Vec<ClipFrame>,
}

/// A frame of a motion.
#[derive(Clone, Debug)]
pub struct ClipFrame {
    /// Rotations of SMPL's 24 joints relative to their parents.
    pub rotations: [Mat3; JOINTS],
    /// Place of the root, y up, metres for an average body.
    pub root: Vec3,
}

impl MotionClip {
    /// The frame at the place `at`, between two; `None` outside of the clip.
    fn at(&self, at: f64) -> Option<ClipFrame> {
        let (first, share) = (at.floor(), at - at.floor());
        if first < 0.0 {
            return None;
        }
        let before = self.frames.get(first as usize)?;
        if share < 1e-6 {
            return Some(before.clone());
        }
        let after = self.frames.get(first as usize + 1)?;
        Some(ClipFrame {
            rotations: std::array::from_fn(|joint| {
                slerp(&before.rotations[joint], &after.rotations[joint], share)
            }),
            root: add(before.root, scale(sub(after.root, before.root), share)),
        })
    }
}

/// A motion around a moment: that of a clip, or parts of several.
pub(super) struct RandomMotion<'a> {
    whole: (&'a MotionClip, f64),
    /// Clips whose joints replace those of the whole body.
    parts: Vec<((&'a MotionClip, f64), &'static [usize])>,
    speed: f64,
    /// Rotations of the joints before those of the clip.
    habits: [Mat3; JOINTS],
}

impl<'a> RandomMotion<'a> {
    pub(super) fn draw(examples: &'a Examples, random: &mut impl Rng) -> Self {
        let whole = examples.moment(random);
        let mut parts: Vec<((&MotionClip, f64), &'static [usize])> = Vec::new();
        if random.random::<f64>() < MIXED {
            parts.push((examples.moment(random), &UPPER));
            if random.random::<f64>() < MIXED_ARM {
                parts.push((examples.moment(random), &LEFT_ARM));
            }
        }
        Self {
            whole,
            parts,
            speed: random.random_range(SPEED[0]..SPEED[1]),
            habits: std::array::from_fn(|joint| {
                let spread = if joint == 0 { 0.0 } else { HABIT };
                rodrigues(std::array::from_fn(|_| spread * normal(random)))
            }),
        }
    }

    /// The frame `after` seconds; `None` outside of a clip.
    pub(super) fn at(&self, after: f64) -> Option<ClipFrame> {
        let at = |(clip, frame): (&MotionClip, f64)| clip.at(frame + after * self.speed * clip.fps);
        let mut frame = at(self.whole)?;
        for (part, joints) in &self.parts {
            let part = at(*part)?;
            for &joint in *joints {
                frame.rotations[joint] = part.rotations[joint];
            }
        }
        for (rotation, habit) in frame.rotations.iter_mut().zip(&self.habits) {
            *rotation = matmul(habit, rotation);
        }
        Some(frame)
    }
}
