//! The gauge of a model that was learned from inexact poses: a rotation of a joint that all poses
//! share is also a change of the canonical body, and no picture tells the two apart.

use yoto_capture::camera::Pose;
use yoto_capture::skeleton::transform::{
    Vec3, add, apply, compose_axis_angle, inverse, rigid, rodrigues, rotate, scale, sub,
};

/// A constant rotation of each joint in its own axes, axis times angle (radians), and a constant shift of
/// the root in its own axes, metres.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Alignment {
    rotations: Vec<Vec3>,
    shift: Vec3,
}

impl Alignment {
    /// The mean change from the exact poses to those that the model was learned from; `None`
    /// without any.
    pub(crate) fn between<'a>(pairs: impl Iterator<Item = (&'a Pose, &'a Pose)>) -> Option<Self> {
        let (mut rotations, mut shift, mut count) = (Vec::new(), [0.0; 3], 0.0);
        for (exact, learned) in pairs {
            let (from, to) = (exact.rotations_f64(), learned.rotations_f64());
            rotations.resize(from.len(), [0.0; 3]);
            for (rotation, (from, to)) in rotations.iter_mut().zip(from.iter().zip(&to)) {
                *rotation = add(*rotation, compose_axis_angle(scale(*from, -1.0), *to));
            }
            let moved = sub(translation(learned), translation(exact));
            shift = add(shift, rotate(&inverse(&root(&from)), moved));
            count += 1.0;
        }
        (count > 0.0).then(|| Self {
            rotations: rotations.iter().map(|it| scale(*it, 1.0 / count)).collect(),
            shift: scale(shift, 1.0 / count),
        })
    }

    /// The exact `pose`, moved to where the model has it.
    pub(crate) fn apply_to(&self, pose: &Pose) -> Pose {
        let exact = pose.rotations_f64();
        let moved = add(translation(pose), apply(&root(&exact), self.shift));
        let rotated = exact.iter().zip(&self.rotations);
        Pose {
            rotations: rotated
                .map(|(exact, rotation)| compose_axis_angle(*exact, *rotation).map(|v| v as f32))
                .collect(),
            translation: moved.map(|v| v as f32),
        }
    }
}

fn translation(pose: &Pose) -> Vec3 {
    pose.translation.map(f64::from)
}

/// The rotation of the root, as a rigid transform `[3, 4]`.
fn root(rotations: &[Vec3]) -> [[f64; 4]; 3] {
    let rotation = rotations.first().copied().unwrap_or_default();
    rigid(rodrigues(rotation), [0.0; 3])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_that_all_poses_share_is_found() {
        let pose = |i: usize| Pose {
            rotations: (0..3)
                .map(|j| [0.3 * i as f32, 0.1 * j as f32, -0.2])
                .collect(),
            translation: [i as f32, 0.5, 3.0],
        };
        let shared = Alignment {
            rotations: vec![[0.05, 0.0, -0.02], [0.0; 3], [0.0, 0.1, 0.0]],
            shift: [0.01, 0.02, -0.03],
        };
        let exact: Vec<Pose> = (0..5).map(pose).collect();
        let learned: Vec<Pose> = exact.iter().map(|it| shared.apply_to(it)).collect();
        let found = Alignment::between(exact.iter().zip(&learned)).expect("poses");
        let same = |a: Vec3, b: Vec3| sub(a, b).iter().all(|v| v.abs() < 1e-6);
        assert!(same(found.shift, shared.shift), "{found:?}");
        for (found, shared) in found.rotations.iter().zip(&shared.rotations) {
            assert!(same(*found, *shared), "{found:?} for {shared:?}");
        }
        assert_eq!(Alignment::between(std::iter::empty()), None);
    }
}
