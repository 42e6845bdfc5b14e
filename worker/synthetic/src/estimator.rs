//! What a pose estimator makes of a film: the exact poses with errors like those of real ones.
//!
//! Errors are smooth in time, larger where the body hides a limb, differ with the heading, and are
//! several times as large along the view as across it. Beside them stand a lean that stays, a wrong
//! focal length with the distance that goes with it, wrong bone lengths, and frames that are
//! altogether wrong.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::{FRAC_1_SQRT_2, TAU};
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::readings::{Reading, Sides};
use yoto_capture::skeleton::transform::{
    Vec3, add, compose_axis_angle, dot, length, normalised, rotate, scale, sub,
};
use yoto_capture::skeleton::{Skeleton, SkeletonError};
use yoto_proto::correction::other_sides;
use yoto_proto::pose_track::{Frame, PoseTrack};

/// Limbs nearer than this to the body's axis, in the picture's plane, are hidden when they are behind
/// it, metres.
const HIDING: f64 = 0.2;
/// How far beside the person a lost track is, metres.
const BESIDE: f64 = 0.4;
/// Frames of a run of mistakes, at most.
const RUN: usize = 3;

/// Sizes of an estimator's errors; 0 turns an error off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimator {
    /// Turn of a joint that changes over the film, root mean square, radians.
    pub turn: f64,
    /// Frames over which it changes.
    pub frames: f64,
    /// Turn of a joint that stays or changes with the heading, radians.
    pub bias: f64,
    /// Factor on the turns of hidden limbs.
    pub hidden: f64,
    /// Place across the view, along each axis, metres.
    pub across: f64,
    /// Place along the view, metres.
    pub along: f64,
    /// Lean towards or away from the camera that stays, radians.
    pub lean: f64,
    /// Focal length, a share of itself.
    pub focal: f64,
    /// Lengths of bones, shares of themselves.
    pub bones: f64,
    /// Share of frames that are altogether wrong, at most a quarter.
    pub mistakes: f64,
}

impl Default for Estimator {
    /// Errors by which the check of a capture finds rendered films as imprecise as a phone video with
    /// automatic poses: 14 to 23 mm, where that video has 15 and the exact poses 11.
    fn default() -> Self {
        Self {
            turn: 0.05,
            frames: 2.5,
            bias: 0.016,
            hidden: 1.5,
            across: 0.005,
            along: 0.03,
            lean: 0.05,
            focal: 0.05,
            bones: 0.02,
            mistakes: 0.03,
        }
    }
}

/// What is altogether wrong with a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mistake {
    /// The body as seen from the other side, or with exchanged limbs.
    Read(Reading),
    /// The pose of another time, beside the person.
    Lost,
}

/// An estimate of a film's poses.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// The poses, bones and cameras that the estimator believes.
    pub track: PoseTrack,
    /// Places of frames that are altogether wrong, rising.
    pub mistakes: Vec<(usize, Mistake)>,
}

impl Estimator {
    /// The estimate of `exact`. The same seed gives the same errors.
    ///
    /// # Errors
    /// Invalid skeleton.
    pub fn estimate(&self, exact: &PoseTrack, seed: u64) -> Result<Estimate, SkeletonError> {
        let skeleton = Skeleton::from_track(&exact.skeleton)?;
        let sides = other_sides(&exact.skeleton).ok();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut track = exact.clone();
        let joints = skeleton.joints();
        let count = track.frames.len();
        let turns: Vec<Vec<Vec3>> = (0..joints).map(|_| self.smooth(count, &mut rng)).collect();
        let places = self.smooth(count, &mut rng);
        let biases: Vec<[Vec3; 2]> = (0..joints)
            .map(|_| [normals(&mut rng), normals(&mut rng)])
            .collect();
        let phases: Vec<f64> = (0..joints).map(|_| rng.random_range(0.0..TAU)).collect();
        let lean = self.lean * normal(&mut rng);
        let focal = 1.0 + self.focal * normal(&mut rng);
        for (i, frame) in track.frames.iter_mut().enumerate() {
            let view = View::of(&skeleton, frame);
            for joint in 0..joints {
                let hidden = if view.hidden[joint] { self.hidden } else { 1.0 };
                let [stays, turns_along] = biases[joint];
                let with_heading = (view.heading - phases[joint]).cos();
                let bias = add(stays, scale(turns_along, with_heading));
                // Each of three axes, and a mean square of 1.5 of the bias.
                let error = add(
                    scale(turns[joint][i], hidden * self.turn / 3f64.sqrt()),
                    scale(bias, self.bias / 4.5f64.sqrt()),
                );
                set(
                    frame,
                    joint,
                    compose_axis_angle(rotation(frame, joint), error),
                );
            }
            // World axes of the camera: across, down, along.
            let [x, y, z] = view.axes;
            set(
                frame,
                0,
                compose_axis_angle(scale(x, lean), rotation(frame, 0)),
            );
            let [u, v, w] = places[i];
            let error = add(scale(x, self.across * u), scale(y, self.across * v));
            let error = add(
                error,
                scale(z, self.along * w + view.distance * (focal - 1.0)),
            );
            frame.translation = add(frame.translation, error);
            for axis in 0..2 {
                frame.k[axis][axis] *= focal;
            }
        }
        self.lengthen(&mut track, &skeleton, sides.as_deref(), &mut rng);
        let sides = sides.map(|other| Sides::new(other, &skeleton.parents));
        let mistakes = self.spoil(&mut track, sides.as_ref(), &mut rng);
        Ok(Estimate { track, mistakes })
    }

    /// Three smooth numbers for each of `count` frames, of variance 1.
    fn smooth(&self, count: usize, rng: &mut ChaCha8Rng) -> Vec<Vec3> {
        let reach = (3.0 * self.frames).ceil() as usize;
        let white: Vec<Vec3> = (0..count + 2 * reach).map(|_| normals(rng)).collect();
        // Correlated over `frames` after a curve that is narrower by the root of 2.
        let spread = (self.frames * FRAC_1_SQRT_2).max(1e-3);
        let curve: Vec<f64> = (0..=2 * reach)
            .map(|i| (-0.5 * ((i as f64 - reach as f64) / spread).powi(2)).exp())
            .collect();
        let norm = curve.iter().map(|w| w * w).sum::<f64>().sqrt();
        let sum = |window: &[Vec3]| {
            let terms = window.iter().zip(&curve);
            terms.fold([0.0; 3], |sum, (v, w)| add(sum, scale(*v, w / norm)))
        };
        white.windows(2 * reach + 1).map(sum).collect()
    }

    /// Changes the lengths of bones, alike on both sides.
    fn lengthen(
        &self,
        track: &mut PoseTrack,
        skeleton: &Skeleton,
        sides: Option<&[usize]>,
        rng: &mut ChaCha8Rng,
    ) {
        let factors: Vec<f64> = (0..skeleton.joints())
            .map(|_| 1.0 + self.bones * normal(rng))
            .collect();
        let rest = &mut track.skeleton.rest_joints;
        for (joint, parent) in skeleton.parents.iter().enumerate() {
            let Some(parent) = *parent else { continue };
            let other = sides.map_or(joint, |sides| sides[joint]);
            let bone = sub(skeleton.rest[joint], skeleton.rest[parent]);
            rest[joint] = add(rest[parent], scale(bone, factors[joint.min(other)]));
        }
    }

    /// Spoils frames in short runs; places and mistakes.
    fn spoil(
        &self,
        track: &mut PoseTrack,
        sides: Option<&Sides>,
        rng: &mut ChaCha8Rng,
    ) -> Vec<(usize, Mistake)> {
        let count = track.frames.len();
        let wanted = (self.mistakes * count as f64).round() as usize;
        let mut found: Vec<(usize, Mistake)> = Vec::new();
        let before = track.clone();
        while found.len() < wanted.min(count / 4) {
            let start = rng.random_range(0..count);
            let run = rng.random_range(1..=RUN).min(wanted - found.len());
            let kind = rng.random_range(0..3);
            for place in start..(start + run).min(count) {
                if found.iter().any(|(other, _)| *other == place) {
                    continue;
                }
                let mistake = match (kind, sides) {
                    (0, Some(sides)) => read(
                        &mut track.frames[place],
                        sides,
                        Reading::FrontToBack,
                        track.image_size,
                    ),
                    (1, Some(sides)) => read(
                        &mut track.frames[place],
                        sides,
                        Reading::Limbs,
                        track.image_size,
                    ),
                    _ => None,
                };
                let mistake = mistake.unwrap_or_else(|| {
                    let from = &before.frames[(place + count / 2) % count];
                    let frame = &mut track.frames[place];
                    let [x, _, _] = View::axes(frame);
                    frame.pose.clone_from(&from.pose);
                    frame.translation = add(frame.translation, scale(x, BESIDE));
                    Mistake::Lost
                });
                found.push((place, mistake));
            }
        }
        found.sort_unstable_by_key(|(place, _)| *place);
        found
    }
}

/// Puts another `reading` of its pose into `frame`; `None` if the frame has no such reading.
fn read(
    frame: &mut Frame,
    sides: &Sides,
    reading: Reading,
    image_size: [u32; 2],
) -> Option<Mistake> {
    let camera = Camera::from_frame(frame, image_size).ok()?;
    let readings = sides.readings(&Pose::from_frame(frame).ok()?, &camera);
    let (_, pose) = readings.into_iter().find(|(it, _)| *it == reading)?;
    frame.pose = (pose.rotations.iter().flatten())
        .map(|v| f64::from(*v))
        .collect();
    Some(Mistake::Read(reading))
}

/// What a frame's camera sees of its body.
struct View {
    /// World directions: across, down and along the view.
    axes: [Vec3; 3],
    /// Distance of the root along the view, metres.
    distance: f64,
    /// Direction that the body faces, from the camera, radians.
    heading: f64,
    /// Which joints the body hides.
    hidden: Vec<bool>,
}

impl View {
    fn axes(frame: &Frame) -> [Vec3; 3] {
        [0, 1, 2].map(|row| {
            let [x, y, z, _] = frame.e[row];
            [x, y, z]
        })
    }

    fn of(skeleton: &Skeleton, frame: &Frame) -> Self {
        let axes = Self::axes(frame);
        let rotations = frame.pose.as_chunks::<3>().0;
        let place = skeleton.global_transforms(rotations);
        let joints: Vec<Vec3> = place
            .iter()
            .map(|m| add([m[0][3], m[1][3], m[2][3]], frame.translation))
            .collect();
        let seen = |point: Vec3| axes.map(|axis| dot(axis, point));
        let root = seen(joints[0]);
        let forward = rotate(&place[0], [0.0, 0.0, 1.0]);
        // The body's axis in the picture's plane: from the root to the highest joint at rest.
        let top = (0..joints.len())
            .max_by(|a, b| skeleton.rest[*a][1].total_cmp(&skeleton.rest[*b][1]))
            .unwrap_or(0);
        let axis = sub(seen(joints[top]), root);
        let axis = normalised([axis[0], axis[1], 0.0]);
        let hidden = joints.iter().map(|joint| {
            let from = sub(seen(*joint), root);
            let flat = [from[0], from[1], 0.0];
            let beside = sub(flat, scale(axis, dot(flat, axis)));
            from[2] > 0.05 && length(beside) < HIDING
        });
        Self {
            distance: root[2] + frame.e[2][3],
            heading: dot(forward, axes[0]).atan2(dot(forward, axes[2])),
            hidden: hidden.collect(),
            axes,
        }
    }
}

fn rotation(frame: &Frame, joint: usize) -> Vec3 {
    let rotations = frame.pose.as_chunks::<3>().0;
    rotations.get(joint).copied().unwrap_or_default()
}

fn set(frame: &mut Frame, joint: usize, to: Vec3) {
    if let Some(rotation) = frame.pose.as_chunks_mut::<3>().0.get_mut(joint) {
        *rotation = to;
    }
}

/// A number of the normal distribution, by Box and Muller.
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let (radius, angle): (f64, f64) = (rng.random(), rng.random());
    (-2.0 * (1.0 - radius).ln()).sqrt() * (TAU * angle).cos()
}

fn normals(rng: &mut ChaCha8Rng) -> Vec3 {
    [normal(rng), normal(rng), normal(rng)]
}

#[cfg(test)]
#[path = "estimator_tests.rs"]
mod tests;
