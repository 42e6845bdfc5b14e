//! What people do with their fingers and faces.

use std::f32::consts::TAU;
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::smpl::{FINGERS, JOINTS, WITH_FACE, WITH_FINGERS};

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
    if pose.rotations.len() < WITH_FINGERS {
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

/// Angles of an open jaw and of a closed eyelid, radians.
const OPEN: f32 = 0.3;
const SHUT: f32 = 0.55;
/// Seconds between words and between blinks, and seconds that a blink lasts.
const WORD: f64 = 0.9;
const BLINKS: f64 = 1.5;
const BLINK: f64 = 0.2;

/// An expression's name, and how far the jaw is open and the eyelids are closed, 0 to 1.
pub(crate) const EXPRESSIONS: [(&str, [f32; 2]); 3] = [
    ("still", [0.0, 0.0]),
    ("open", [1.0, 0.0]),
    ("shut", [0.0, 1.0]),
];

/// Opens the jaw and closes the eyelids of `pose` as far as told; nothing if it has no face.
pub(crate) fn express(pose: &mut Pose, [jaw, eyelids]: [f32; 2]) {
    if pose.rotations.len() == WITH_FACE {
        let [.., left, right] = &mut pose.rotations[WITH_FINGERS..] else {
            return;
        };
        (*left, *right) = ([eyelids * SHUT, 0.0, 0.0], [eyelids * SHUT, 0.0, 0.0]);
        pose.rotations[WITH_FINGERS] = [jaw * OPEN, 0.0, 0.0];
    }
}

/// The face at a time of a film, seconds: it speaks and blinks.
pub(crate) fn speak(pose: &mut Pose, seconds: f64) {
    let jaw = 0.5 - 0.5 * (TAU * (seconds / WORD) as f32).cos();
    let is_shut = seconds.rem_euclid(BLINKS) > BLINKS - BLINK;
    express(pose, [jaw, if is_shut { 1.0 } else { 0.0 }]);
}

/// The fingers at a time of a film, seconds: they open and close, one after the other.
pub(crate) fn wave(pose: &mut Pose, seconds: f64) {
    let turn = (seconds / PERIOD) as f32;
    close(pose, |finger| {
        0.5 - 0.5 * (TAU * (turn - 0.08 * finger as f32)).cos()
    });
}
