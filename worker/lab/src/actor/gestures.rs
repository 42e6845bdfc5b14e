//! What people do with their fingers.

use std::f32::consts::TAU;
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::smpl::{FINGERS, JOINTS, WITH_FINGERS};

/// How far each joint of a finger bends when the finger is closed, radians.
const CLOSED: [f32; 3] = [1.3, 1.5, 0.9];
/// Index of the thumb among a hand's fingers.
const THUMB: usize = 4;
/// Seconds in which a hand of a film opens and closes once.
const PERIOD: f64 = 1.6;

/// A gesture's name, and how far index, middle, little and ring finger are closed, 0 to 1.
pub(crate) const GESTURES: [(&str, [f32; 4]); 4] = [
    ("flat", [0.0; 4]),
    ("half", [0.5; 4]),
    ("fist", [1.0; 4]),
    ("point", [0.0, 1.0, 1.0, 1.0]),
];

/// Closes the fingers of both hands of `pose` as far as told; nothing if it has no fingers. The thumb stays.
pub(crate) fn close(pose: &mut Pose, how_far: impl Fn(usize) -> f32) {
    if pose.rotations.len() != WITH_FINGERS {
        return;
    }
    let half = FINGERS.len() / 2;
    for joint in 0..FINGERS.len() {
        let (side, finger) = (joint / half, joint % half / 3);
        if finger != THUMB {
            // Palms face down, and arms point to the sides.
            let sign = if side == 0 { -1.0 } else { 1.0 };
            let angle = sign * how_far(finger) * CLOSED[joint % 3];
            pose.rotations[JOINTS.len() + joint] = [0.0, 0.0, angle];
        }
    }
}

/// The fingers at a time of a film, seconds: they open and close, one after the other.
pub(crate) fn wave(pose: &mut Pose, seconds: f64) {
    let turn = (seconds / PERIOD) as f32;
    close(pose, |finger| {
        0.5 - 0.5 * (TAU * (turn - 0.08 * finger as f32)).cos()
    });
}
