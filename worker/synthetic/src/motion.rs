//! The motion of a synthetic person.

use super::build::joint;
use std::f64::consts::{PI, TAU};
use yoto_capture::skeleton::transform::compose_axis_angle;
use yoto_capture::skeleton::{Pose, Skeleton, Vec3};

/// The individual parameters of a person's motion.
#[derive(Clone, Debug)]
pub(crate) struct Gait {
    /// Direction of their turns: 1 or -1.
    pub turn: f64,
    /// Phase of their steps, radians.
    pub phase: f64,
    /// Size of their steps and arm swings; 1 is average.
    pub vigour: f64,
}

/// Turns in a filmed motion: two, so that each side is seen in different steps.
const TURNS: f64 = 2.0;
/// Strides in a filmed motion; no multiple of the turns.
const STRIDES: f64 = 7.0;

/// Joint rotations under construction, axis-angle, radians.
pub(crate) struct Stance(Vec<Vec3>);

impl Stance {
    /// All joints as at rest.
    pub(crate) fn rest(skeleton: &Skeleton) -> Self {
        Self(vec![[0.0; 3]; skeleton.joints()])
    }

    /// Sets a joint.
    pub(crate) fn set(&mut self, joint: usize, rotation: Vec3) {
        self.0[joint] = rotation;
    }

    /// Sets the left joint, and the right one to the mirrored rotation.
    pub(crate) fn set_both(&mut self, left: usize, rotation: Vec3) {
        let [x, y, z] = rotation;
        self.set(left, rotation);
        self.set(left + 1, [x, -y, -z]);
    }

    /// The pose with the lowest foot on the floor, or `lift` metres above it in a jump.
    pub(crate) fn stand(self, skeleton: &Skeleton, lift: f64) -> Pose {
        let mut pose = Pose {
            rotations: self.0.iter().map(|r| r.map(|v| v as f32)).collect(),
            translation: [0.0; 3],
        };
        let feet = [joint::L_ANKLE, joint::L_FOOT].map(|left| [left, left + 1]);
        let lowest = |joints: &[Vec3]| {
            let heights = feet.as_flattened().iter().map(|&joint| joints[joint][1]);
            heights.fold(f64::INFINITY, f64::min)
        };
        let sunk = lowest(&skeleton.rest) - lowest(&skeleton.posed_joints(&pose));
        pose.translation[1] = (sunk + lift) as f32;
        pose
    }
}

impl Gait {
    /// Walking on the spot, turning, waving, and raising the arms.
    pub(crate) fn filmed(&self, skeleton: &Skeleton, frames: usize) -> Vec<Pose> {
        (0..frames)
            .map(|frame| {
                let time = frame as f64 / frames as f64;
                self.walk(skeleton, time)
            })
            .collect()
    }

    fn walk(&self, skeleton: &Skeleton, time: f64) -> Pose {
        let step = TAU * STRIDES * time + self.phase;
        let swing = step.sin() * self.vigour;
        let mut stance = Stance::rest(skeleton);
        stance.set(
            joint::PELVIS,
            [0.0, wrapped(self.turn * TAU * TURNS * time), 0.0],
        );
        for (side, swing) in [(0, swing), (1, -swing)] {
            let lifted = (0.5 + 0.5 * (step + PI * side as f64).cos()) * self.vigour;
            stance.set(
                joint::L_HIP + side,
                [-0.4 * swing - 0.25 * lifted, 0.0, 0.0],
            );
            stance.set(joint::L_KNEE + side, [0.1 + 0.9 * lifted, 0.0, 0.0]);
            stance.set(
                joint::L_ANKLE + side,
                [0.25 * swing - 0.2 * lifted, 0.0, 0.0],
            );
        }
        stance.set(joint::SPINE1, [0.05, 0.1 * swing, 0.03 * swing]);
        stance.set(joint::SPINE3, [0.0, -0.18 * swing, 0.0]);
        stance.set(joint::NECK, [0.1 * (2.0 * step).sin(), 0.0, 0.0]);
        stance.set(joint::HEAD, [0.0, 0.35 * (TAU * 3.0 * time).sin(), 0.0]);

        // Each arm is raised during a part of the time: at 0 it hangs, at 1 it is straight out, at 1.6 up.
        let right = 1.65 * bump(time, 0.08, 0.3) + 1.1 * bump(time, 0.62, 0.8);
        let left = 1.55 * bump(time, 0.36, 0.58) + 1.1 * bump(time, 0.62, 0.8);
        for (side, sign, raised, swing) in [(0, 1.0, left, -swing), (1, -1.0, right, swing)] {
            let hanging = (1.0 - raised).clamp(0.0, 1.0);
            let lowered = -sign * 1.25 * (1.0 - raised);
            let forward = [-0.55 * swing * hanging, 0.0, 0.0];
            stance.set(
                joint::L_SHOULDER + side,
                compose_axis_angle(forward, [0.0, 0.0, lowered]),
            );
            let bend = 0.25 + 0.85 * hanging * (0.5 + 0.5 * swing);
            let waving = bump(raised, 1.0, 2.0) * (0.8 + 0.5 * (TAU * 9.0 * time).sin());
            stance.set(
                joint::L_ELBOW + side,
                compose_axis_angle([0.0, -sign * bend, 0.0], [0.0, 0.0, sign * waving]),
            );
            stance.set(joint::L_WRIST + side, [0.0, 0.0, -sign * 0.2 * waving]);
        }
        stance.stand(skeleton, 0.0)
    }

    /// Jumping jacks in the first half, squats in the second.
    pub(crate) fn unseen(&self, skeleton: &Skeleton, frames: usize) -> Vec<Pose> {
        (0..frames)
            .map(|frame| {
                let time = frame as f64 / frames as f64;
                let effort = 0.5 - 0.5 * (TAU * 4.0 * time).cos();
                let facing = wrapped(self.turn * (TAU * time - 0.6));
                if time < 0.5 {
                    jack(skeleton, facing, effort)
                } else {
                    squat(skeleton, facing, effort)
                }
            })
            .collect()
    }
}

fn jack(skeleton: &Skeleton, facing: f64, effort: f64) -> Pose {
    let mut stance = Stance::rest(skeleton);
    stance.set(joint::PELVIS, [0.0, facing, 0.0]);
    stance.set_both(joint::L_HIP, [-0.1, 0.0, 0.4 * effort]);
    stance.set_both(joint::L_KNEE, [0.2, 0.0, 0.0]);
    stance.set_both(joint::L_ANKLE, [-0.1, 0.0, -0.2 * effort]);
    stance.set_both(joint::L_SHOULDER, [0.0, 0.0, -1.2 + 1.75 * effort]);
    stance.set_both(joint::L_ELBOW, [0.0, -0.2 - 0.7 * effort, 0.15]);
    stance.stand(skeleton, 0.05 * effort)
}

fn squat(skeleton: &Skeleton, facing: f64, effort: f64) -> Pose {
    let mut stance = Stance::rest(skeleton);
    stance.set(joint::PELVIS, [0.0, facing, 0.0]);
    stance.set_both(joint::L_HIP, [-1.35 * effort, 0.0, 0.2]);
    stance.set_both(joint::L_KNEE, [1.9 * effort, 0.0, 0.0]);
    stance.set_both(joint::L_ANKLE, [-0.6 * effort, 0.0, -0.15]);
    stance.set(joint::SPINE1, [0.35 * effort, 0.0, 0.0]);
    stance.set(joint::SPINE2, [0.2 * effort, 0.0, 0.0]);
    stance.set(joint::NECK, [-0.3 * effort, 0.0, 0.0]);
    let arms = compose_axis_angle([0.0, -1.2 * effort, 0.0], [0.0, 0.0, -1.2 * (1.0 - effort)]);
    stance.set_both(joint::L_SHOULDER, arms);
    stance.set_both(joint::L_ELBOW, [0.0, -0.3 - 0.8 * effort, 0.0]);
    stance.stand(skeleton, 0.0)
}

/// Rises from 0 at `from` to 1 midway to `to` and falls again.
fn bump(x: f64, from: f64, to: f64) -> f64 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    (t * PI).sin().powi(2)
}

/// The angle between -π and π.
pub(crate) fn wrapped(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}
