//! The refined poses of one person's training frames.
//!
//! Estimated poses are off by what changes slowly from frame to frame. A change is therefore a
//! piecewise linear function of time: a knot every few frames, each `[K + 1, 3]`, the axis-angle
//! vectors that follow the joints' rotations (radians) and the shift of the root (metres, in the
//! root's axes). A step on a frame moves the two knots beside it, down the mean of the gradients
//! that each has seen.
//!
//! Adam's second moments are shared by all knots, and each is raised by the mean of its kind
//! (rotations, places). A knot sees tens of steps only, from which its own moments could not be
//! told; and a joint that hardly changes the picture must not move as far as one that does.

use super::Trainer;
use crate::config::RefinementConfig;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::transform::{add, after, apply, rigid, rodrigues};
use yoto_proto::pose_track::PoseTrack;

const BETA_1: f64 = 0.9;
const BETA_2: f64 = 0.99;
/// Share of a kind's mean in each second moment.
const COMMON: f64 = 0.5;
/// Added to the root of the second moment.
const EPSILON: f64 = 1e-12;

/// Changes of a track's poses.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct PoseRefinement {
    /// Fingerprint of the poses that were given.
    track: String,
    spacing: usize,
    knots: Vec<Knot>,
    /// Second moments, `[3 (K + 1)]`, and the steps that they were taken from.
    squares: Vec<f32>,
    steps: i32,
}

/// `[3 (K + 1)]` each.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Knot {
    values: Vec<f32>,
    first: Vec<f32>,
    steps: i32,
}

impl PoseRefinement {
    /// No change yet of the poses of `track`.
    pub fn new(config: &RefinementConfig, track: &PoseTrack) -> Self {
        let blank = Self::blank(config, track.frames.len(), track.joints());
        Self {
            track: fingerprint(track),
            ..blank
        }
    }

    /// No change yet, for `frames` frames of a skeleton with `joints` joints.
    fn blank(config: &RefinementConfig, frames: usize, joints: usize) -> Self {
        let width = 3 * (joints + 1);
        let zeros = Knot {
            values: vec![0.0; width],
            first: vec![0.0; width],
            steps: 0,
        };
        Self {
            track: String::new(),
            spacing: config.spacing,
            knots: vec![zeros; frames.div_ceil(config.spacing) + 1],
            squares: vec![0.0; width],
            steps: 0,
        }
    }

    /// Whether the changes are those of a skeleton with `joints` joints.
    pub fn fits(&self, joints: usize) -> bool {
        let width = 3 * (joints + 1);
        let whole = |values: &Vec<f32>| values.len() == width;
        let knots = self.knots.iter();
        self.spacing > 0
            && whole(&self.squares)
            && knots.clone().all(|k| whole(&k.values) && whole(&k.first))
    }

    /// Whether the changes are of the same poses as those of `other`, with the same knots.
    pub fn continues(&self, other: &Self) -> bool {
        let key = |it: &Self| (it.spacing, it.knots.len());
        self.track == other.track && key(self) == key(other)
    }

    /// The knots beside the frame at `place` in the track, and their weights.
    fn beside(&self, place: usize) -> [(usize, f32); 2] {
        let knot = place / self.spacing;
        let share = (place % self.spacing) as f32 / self.spacing as f32;
        [(knot, 1.0 - share), (knot + 1, share)]
    }

    /// The change of the frame at `place` in the track, `[3 (K + 1)]`.
    pub fn change(&self, place: usize) -> Vec<f32> {
        let [(a, at_a), (b, at_b)] = self.beside(place);
        let pairs = self.knots[a].values.iter().zip(&self.knots[b].values);
        pairs.map(|(a, b)| at_a * a + at_b * b).collect()
    }

    /// `pose` of the frame at `place` in the track with its change; the root's joint rests at
    /// `root`, metres.
    fn refined(&self, place: usize, pose: &Pose) -> Pose {
        let change = self.change(place);
        let (changes, _) = change.as_chunks::<3>();
        let given = pose.rotations_f64();
        let rotations = given
            .iter()
            .zip(changes)
            .map(|(given, change)| after(*given, change.map(f64::from)).map(|v| v as f32));
        let shift = changes.last().map_or([0.0; 3], |v| v.map(f64::from));
        let turn = rigid(rodrigues(given[0]), [0.0; 3]);
        let place = add(pose.translation.map(f64::from), apply(&turn, shift));
        Pose {
            rotations: rotations.collect(),
            translation: place.map(|v| v as f32),
        }
    }

    /// Takes a step down the gradient `[3 (K + 1)]` to the change at `place`, with the factor
    /// `scale` on the rates. A gradient that is not finite is ignored.
    pub fn learn(&mut self, config: &RefinementConfig, place: usize, gradient: &[f32], scale: f64) {
        if gradient.iter().any(|g| !g.is_finite()) {
            return;
        }
        self.steps += 1;
        for (square, slope) in self.squares.iter_mut().zip(gradient) {
            let new = BETA_2 * f64::from(*square) + (1.0 - BETA_2) * f64::from(*slope).powi(2);
            *square = new as f32;
        }
        let rotations = gradient.len() - 3;
        let (of_rotations, of_place) = self.squares.split_at(rotations);
        let mean = |squares: &[f32]| {
            squares.iter().map(|s| f64::from(*s)).sum::<f64>() / squares.len() as f64
        };
        let kinds = [
            (config.rotation_rate, mean(of_rotations)),
            (config.place_rate, mean(of_place)),
        ];
        let seen = 1.0 - BETA_2.powi(self.steps);
        for (knot, weight) in self.beside(place) {
            if weight == 0.0 {
                continue;
            }
            let knot = &mut self.knots[knot];
            knot.steps += 1;
            for (i, slope) in gradient.iter().enumerate() {
                let (rate, common) = kinds[usize::from(i >= rotations)];
                let slope = f64::from(slope * weight);
                let first = BETA_1 * f64::from(knot.first[i]) + (1.0 - BETA_1) * slope;
                knot.first[i] = first as f32;
                let mean = first / (1.0 - BETA_1.powi(knot.steps));
                let square = (1.0 - COMMON) * f64::from(self.squares[i]) + COMMON * common;
                let step = scale * rate * mean / ((square / seen).sqrt() + EPSILON);
                knot.values[i] = (f64::from(knot.values[i]) - step) as f32;
            }
        }
    }
}

/// SHA-256 of a track's poses.
fn fingerprint(track: &PoseTrack) -> String {
    let mut hash = Sha256::new();
    for frame in &track.frames {
        for number in frame.pose.iter().chain(&frame.translation) {
            hash.update(number.to_le_bytes());
        }
    }
    let digest = hash.finalize();
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

impl Trainer {
    /// The pose of each training frame of the person in `slot` as training has refined it, with the
    /// frame's place in the pose track; empty where poses stay as they are given.
    pub fn refined_poses(&self, slot: usize) -> Vec<(usize, Pose)> {
        let subject = self.subjects.iter().find(|it| it.slot == slot);
        let poses = self.state.poses.get(slot).and_then(Option::as_ref);
        let (Some(subject), Some(poses)) = (subject, poses) else {
            return Vec::new();
        };
        let frames = subject.frames.iter();
        frames
            .map(|frame| (frame.place, poses.refined(frame.place, &frame.pose)))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::ModelConfig;
    use crate::motion::body::Body;
    use crate::motion::posed::{corrected_transforms, transforms};
    use crate::render::frame::read;
    use burn::tensor::{Device, Tensor, TensorData};
    use yoto_capture::skeleton::Skeleton;
    use yoto_capture::skeleton::transform::{inverse, length, sub};
    use yoto_capture::synthetic::SyntheticPerson;

    const CONFIG: RefinementConfig = RefinementConfig {
        rotation_rate: 1e-2,
        place_rate: 1e-3,
        start: 0.0,
        spacing: 3,
    };

    fn rows(transforms: Tensor<2>) -> Vec<[f64; 12]> {
        let values = read(transforms).expect("reads");
        let rows = values.as_chunks::<12>().0.iter();
        rows.map(|row| row.map(f64::from)).collect()
    }

    fn moved(row: &[f64; 12], [x, y, z]: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|a| {
            row[4 * a] * x + row[4 * a + 1] * y + row[4 * a + 2] * z + row[4 * a + 3]
        })
    }

    /// A changed pose leads a point of the world to the same place by the transforms of the given
    /// body frame and the change as by those of the refined pose in its own frame.
    #[test]
    fn the_refined_pose_is_the_one_that_training_used() {
        let person = &SyntheticPerson::cast(1, 7)[0];
        let config = ModelConfig::named("draft", "yoto").expect("a tier");
        let skeleton = Skeleton::from_track(&person.skeleton()).expect("valid");
        let body = Body::new(skeleton, &config, &Device::flex());
        let joints = body.skeleton.joints();
        let given = person.motion(12).swap_remove(5);
        let mut poses = PoseRefinement::blank(&CONFIG, 12, joints);
        for (k, knot) in poses.knots.iter_mut().enumerate() {
            for (i, value) in knot.values.iter_mut().enumerate() {
                *value = 0.2 * ((7 * k + i) as f32).sin();
            }
        }
        let change = poses.change(5);
        let change =
            Tensor::<2>::from_data(TensorData::new(change, [joints + 1, 3]), &Device::flex());
        let refined = poses.refined(5, &given);
        let used = rows(corrected_transforms(&body, &given, None, Some(change)));
        let own = rows(transforms(&body, &refined));
        let frames = [&given, &refined].map(|pose| inverse(&body.skeleton.body_to_world(pose)));
        for point in [[0.3, 1.2, 0.1], [-0.5, 0.2, 3.0]] {
            let [in_given, in_refined] = frames.map(|frame| apply(&frame, point));
            for (used, own) in used.iter().zip(&own) {
                let apart = length(sub(moved(used, in_given), moved(own, in_refined)));
                assert!(apart < 1e-5, "{apart} m");
            }
        }
    }

    #[test]
    fn a_step_moves_the_knots_beside_its_frame_and_no_others() {
        let mut poses = PoseRefinement::blank(&CONFIG, 10, 1);
        let gradient = [1.0, -1.0, 0.0, 2.0, 0.0, 0.0];
        poses.learn(&CONFIG, 4, &gradient, 1.0);
        assert_eq!(poses.change(0), [0.0; 6]);
        assert_eq!(poses.change(9), [0.0; 6]);
        let here = poses.change(4);
        assert!(here[0] < 0.0 && here[1] > 0.0 && here[3] < 0.0, "{here:?}");
        assert_eq!((here[2], here[4]), (0.0, 0.0));
        let before = poses.clone();
        poses.learn(&CONFIG, 4, &[f32::NAN, 0.0, 0.0, 0.0, 0.0, 0.0], 1.0);
        assert_eq!(poses, before, "not a number teaches nothing");
    }

    #[test]
    fn another_film_of_the_same_length_starts_anew() {
        let (track, _) = SyntheticPerson::cast(1, 7)[0].capture(4, 32);
        let mut other = track.clone();
        other.frames[3].translation[1] += 1e-9;
        let of = |track: &PoseTrack| PoseRefinement::new(&CONFIG, track);
        assert!(of(&track).continues(&of(&track)));
        assert!(!of(&track).continues(&of(&other)));
    }

    #[test]
    fn changes_are_linear_between_knots() {
        let mut poses = PoseRefinement::blank(&CONFIG, 7, 1);
        poses.knots[1].values[0] = 0.3;
        let changes: Vec<f32> = (0..7).map(|place| poses.change(place)[0]).collect();
        for (found, expected) in changes.iter().zip([0.0, 0.1, 0.2, 0.3, 0.2, 0.1, 0.0]) {
            assert!((found - expected).abs() < 1e-6, "{changes:?}");
        }
    }
}
