//! A simulated pose estimator: exact poses with errors like those of real estimators.
//!
//! Errors are smooth in time, larger for limbs that the body hides, change with the heading, and are
//! several times as large along the view as across it. There are also a constant lean, a wrong focal
//! length with the distance to match, wrong bone lengths, and frames that are completely wrong.

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

/// A limb behind the body is hidden if it is nearer than this to the body's axis in the picture's plane,
/// metres.
const HIDING: f64 = 0.2;
/// Sideways distance of a lost track from the person, metres.
const BESIDE: f64 = 0.4;
/// Most frames in a run of mistakes.
const RUN: usize = 3;

/// The sizes of an estimator's errors; 0 disables an error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimator {
    /// Rotation error of a joint that changes over the film, root mean square, radians.
    pub rotation: f64,
    /// Frames over which it changes.
    pub frames: f64,
    /// Rotation error of a joint that is constant or changes with the heading, radians.
    pub bias: f64,
    /// Factor on the rotation errors of hidden limbs.
    pub hidden: f64,
    /// Position error across the view, along each axis, metres.
    pub across: f64,
    /// Position error along the view, metres.
    pub along: f64,
    /// Constant lean towards or away from the camera, radians.
    pub lean: f64,
    /// Relative error of the focal length.
    pub focal: f64,
    /// Relative error of bone lengths.
    pub bones: f64,
    /// Share of frames that are completely wrong, at most a quarter.
    pub mistakes: f64,
}

impl Default for Estimator {
    /// Errors with which the check of a capture measures rendered films like a phone video with automatic
    /// poses: 14 to 23 mm, while that video has 15 mm and exact poses have 11 mm.
    fn default() -> Self {
        Self {
            rotation: 0.05,
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

/// A mistake that makes a frame completely wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mistake {
    /// The body from the other side, or with exchanged limbs.
    Read(Reading),
    /// The pose of another time, beside the person.
    Lost,
}

/// The estimate of a film's poses.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// Poses, bones and cameras by the estimator.
    pub track: PoseTrack,
    /// Positions of completely wrong frames in the track, ascending.
    pub mistakes: Vec<(usize, Mistake)>,
}

impl Estimator {
    /// The estimate of `exact`. The same seed gives the same errors.
    ///
    /// # Errors
    /// If the track's skeleton is invalid.
    pub fn estimate(&self, exact: &PoseTrack, seed: u64) -> Result<Estimate, SkeletonError> {
        let skeleton = Skeleton::from_track(&exact.skeleton)?;
        let sides = other_sides(&exact.skeleton).ok();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut track = exact.clone();
        let joints = skeleton.joints();
        let count = track.frames.len();
        let rotations: Vec<Vec<Vec3>> = (0..joints).map(|_| self.smooth(count, &mut rng)).collect();
        let positions = self.smooth(count, &mut rng);
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
                // Each error has three axes, hence √3. The bias's parts have a mean square of 1 and, with
                // the cosine, of ½: √(3 · 1.5) in all.
                let error = add(
                    scale(rotations[joint][i], hidden * self.rotation / 3f64.sqrt()),
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
            let [u, v, w] = positions[i];
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

    /// For each of `count` frames three random numbers with variance 1 that are smooth over time.
    fn smooth(&self, count: usize, rng: &mut ChaCha8Rng) -> Vec<Vec3> {
        let reach = (3.0 * self.frames).ceil() as usize;
        let white: Vec<Vec3> = (0..count + 2 * reach).map(|_| normals(rng)).collect();
        // Noise that is blurred with a Gaussian is correlated over √2 times the Gaussian's width.
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

    /// Changes the lengths of bones, equally on both sides.
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

    /// Puts mistakes into short runs of frames. Returns the frames' positions with the mistakes.
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
            for position in start..(start + run).min(count) {
                if found.iter().any(|(other, _)| *other == position) {
                    continue;
                }
                let mistake = match (kind, sides) {
                    (0, Some(sides)) => read(
                        &mut track.frames[position],
                        sides,
                        Reading::FrontToBack,
                        track.image_size,
                    ),
                    (1, Some(sides)) => read(
                        &mut track.frames[position],
                        sides,
                        Reading::Limbs,
                        track.image_size,
                    ),
                    _ => None,
                };
                let mistake = mistake.unwrap_or_else(|| {
                    let from = &before.frames[(position + count / 2) % count];
                    let frame = &mut track.frames[position];
                    let [x, _, _] = View::axes(frame);
                    frame.pose.clone_from(&from.pose);
                    frame.translation = add(frame.translation, scale(x, BESIDE));
                    Mistake::Lost
                });
                found.push((position, mistake));
            }
        }
        found.sort_unstable_by_key(|(position, _)| *position);
        found
    }
}

/// Replaces the pose of `frame` by another `reading` of it; `None` if there is no such reading.
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

/// The view of a frame's camera on its body.
struct View {
    /// World directions: across, down and along the view.
    axes: [Vec3; 3],
    /// Distance of the root along the view, metres.
    distance: f64,
    /// Heading of the body relative to the camera, radians.
    heading: f64,
    /// For each joint, whether the body hides it.
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
        let transforms = skeleton.global_transforms(rotations);
        let joints: Vec<Vec3> = transforms
            .iter()
            .map(|m| add([m[0][3], m[1][3], m[2][3]], frame.translation))
            .collect();
        let seen = |point: Vec3| axes.map(|axis| dot(axis, point));
        let root = seen(joints[0]);
        let forward = rotate(&transforms[0], [0.0, 0.0, 1.0]);
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

/// A random number with the standard normal distribution, by the Box-Muller transform.
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
