//! A change of a pose.

use super::StepPrior;
use crate::config::RefinementConfig;
use serde::{Deserialize, Serialize};
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::transform::{add, apply, compose_axis_angle, rigid, rodrigues};

/// `[3 (K + 1)]`: an axis-angle vector c per joint, radians, and a shift s, metres. Rotation R
/// becomes R exp(c), and the root's position moves by s along the axes of its given rotation. In single
/// precision, which a file of JSON gives back exactly.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub(crate) struct PoseChange(pub Vec<f32>);

impl PoseChange {
    /// No change of a pose of `joints` joints.
    pub(crate) fn none(joints: usize) -> Self {
        Self(vec![0.0; 3 * (joints + 1)])
    }

    /// `pose` with this change.
    pub(crate) fn of(&self, pose: &Pose) -> Pose {
        let change: Vec<f64> = self.0.iter().map(|v| f64::from(*v)).collect();
        let (rotations, shift) = parts(&change);
        let given = pose.rotations_f64();
        let rotations = (given.iter().zip(rotations))
            .map(|(given, rotation)| compose_axis_angle(*given, *rotation).map(|v| v as f32))
            .collect();
        let root = rigid(
            rodrigues(given.first().copied().unwrap_or_default()),
            [0.0; 3],
        );
        let position = add(pose.translation.map(f64::from), apply(&root, shift));
        Pose {
            rotations,
            translation: position.map(|v| v as f32),
        }
    }

    /// The prior on each parameter's return to the given pose. `config` has the expected errors, which are multiplied by
    /// `scale`: the factor of rotations, and that of the position.
    pub(crate) fn priors(&self, config: &RefinementConfig, scale: [f64; 2]) -> Vec<StepPrior> {
        let rotations = self.0.len() - 3;
        (self.0.iter().enumerate())
            .map(|(i, now)| {
                let error = if i < rotations {
                    scale[0] * config.rotation
                } else {
                    scale[1] * config.shift
                };
                StepPrior {
                    mean: -f64::from(*now),
                    precision: error.powi(-2),
                }
            })
            .collect()
    }

    /// Moves it by the share `by` of a `step` `[3 (K + 1)]` in the axes of the changed pose.
    pub(crate) fn take(&mut self, step: &[f64], by: f64) {
        let (steps, shift) = parts(step);
        let (vectors, _) = self.0.as_chunks_mut::<3>();
        let Some((position, rotations)) = vectors.split_last_mut() else {
            return;
        };
        let root = rotations.first().copied().unwrap_or_default();
        let root = rodrigues(root.map(f64::from));
        let shift = apply(&rigid(root, [0.0; 3]), shift.map(|v| by * v));
        *position = add(position.map(f64::from), shift).map(|v| v as f32);
        for (rotation, step) in rotations.iter_mut().zip(steps) {
            let rotated = compose_axis_angle(rotation.map(f64::from), step.map(|v| by * v));
            *rotation = rotated.map(|v| v as f32);
        }
    }
}

/// Rotations, and the shift of the root.
fn parts(change: &[f64]) -> (&[[f64; 3]], [f64; 3]) {
    let (vectors, _) = change.as_chunks::<3>();
    match vectors.split_last() {
        Some((shift, rotations)) => (rotations, *shift),
        None => (&[], [0.0; 3]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_capture::skeleton::Skeleton;
    use yoto_capture::skeleton::transform::{compose, length, rotate, sub};
    use yoto_synthetic::SyntheticPerson;

    #[test]
    fn a_step_is_taken_in_the_axes_of_the_changed_pose() {
        let (track, _) = SyntheticPerson::cast(1, 7)[0].capture(8, 32);
        let skeleton = Skeleton::from_track(&track.skeleton).expect("a skeleton");
        let given = Pose::from_frame(&track.frames[3]).expect("a pose");
        let width = 3 * (track.joints() + 1);
        // First all joints, then the elbow alone, by 0.1 rad about its z.
        let mut change = PoseChange((0..width).map(|i| 0.1 * (i as f32).sin()).collect());
        let before = change.of(&given);
        let elbow = 18;
        let mut step = vec![0.0; width];
        step[3 * elbow + 2] = 0.2;
        step[width - 3] = 0.4;
        change.take(&step, 0.5);
        let after = change.of(&given);
        let global =
            |pose: &Pose, joint: usize| skeleton.global_transforms(&pose.rotations_f64())[joint];
        let rotation = rigid(rodrigues([0.0, 0.0, 0.1]), [0.0; 3]);
        let expected = compose(&global(&before, elbow), &rotation);
        let found = global(&after, elbow);
        for axis in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] {
            assert!(length(sub(rotate(&expected, axis), rotate(&found, axis))) < 1e-5);
        }
        let expected = rotate(&global(&before, 0), [0.2, 0.0, 0.0]);
        let [from, to] = [&before, &after].map(|pose| pose.translation.map(f64::from));
        assert!(length(sub(expected, sub(to, from))) < 1e-5);
    }
}
