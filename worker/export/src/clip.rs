//! Motions by name.

use yoto_capture::camera::Pose;
use yoto_capture::skeleton::transform::{
    Mat34, Vec3, add, apply, cross, dot, length, normalised, position, rigid, rodrigues, scale,
    sub, to_quaternion,
};
use yoto_capture::skeleton::{Skeleton, SkeletonError};

/// The up axis of a world whose file does not tell.
pub(crate) const UP: Vec3 = [0.0, 1.0, 0.0];

/// A motion of a person's skeleton.
#[derive(Clone, Debug, PartialEq)]
pub struct Clip {
    /// Name of the motion.
    pub name: String,
    /// Frames per second.
    pub fps: f64,
    /// The poses, at least one.
    pub poses: Vec<Pose>,
    /// The up axis of the motion's world, of length 1.
    pub up: Vec3,
}

impl Clip {
    /// A motion of a single frame: the rest pose of `skeleton`.
    pub fn rest(skeleton: &Skeleton) -> Self {
        Self {
            name: "rest".into(),
            fps: 1.0,
            poses: vec![Pose::rest(skeleton.joints())],
            up: UP,
        }
    }

    /// The motion from the clip's world to one with y up in which the person stands on the origin and faces
    /// z, on average over the frames. The clip's up axis becomes y, however the person leans: the floor stays level.
    ///
    /// # Errors
    /// If a pose does not fit `skeleton`.
    pub fn stand(&self, skeleton: &Skeleton) -> Result<Mat34, SkeletonError> {
        let mut front = [0.0; 3];
        let mut joints: Vec<Vec3> = Vec::new();
        for pose in &self.poses {
            skeleton.check_pose(pose)?;
            let transforms = skeleton.world_transforms(pose);
            if let Some(root) = transforms.first() {
                front = add(front, root.map(|row| row[2]));
            }
            joints.extend(transforms.iter().map(position));
        }
        let up = normalised(self.up);
        let mut front = sub(front, scale(up, dot(front, up)));
        if length(front) < 1e-3 {
            // A person who turns all the way round has no mean front.
            let any = if up[0].abs() < 0.9 {
                [1.0, 0.0, 0.0]
            } else {
                [0.0, 1.0, 0.0]
            };
            front = cross(up, any);
        }
        let front = normalised(front);
        let level = rigid([cross(up, front), up, front], [0.0; 3]);
        let positions: Vec<Vec3> = joints.iter().map(|joint| apply(&level, *joint)).collect();
        let sum = positions
            .iter()
            .fold([0.0; 3], |sum, joint| add(sum, *joint));
        let [x, _, z] = scale(sum, -1.0 / positions.len().max(1) as f64);
        let lowest = positions
            .iter()
            .map(|joint| joint[1])
            .fold(f64::INFINITY, f64::min);
        let lowest = if positions.is_empty() { 0.0 } else { lowest };
        Ok(rigid([cross(up, front), up, front], [x, -lowest, z]))
    }

    /// The clip as little-endian bytes. For each frame: the root's translation as 3 numbers of 32 bits,
    /// metres, then for each joint its rotation as a quaternion of 4 numbers of 16 bits, real part first.
    ///
    /// # Errors
    /// If a pose does not fit `skeleton`.
    pub(crate) fn packed(&self, skeleton: &Skeleton) -> Result<Vec<u8>, SkeletonError> {
        let mut bytes = Vec::new();
        for pose in &self.poses {
            skeleton.check_pose(pose)?;
            let shift = pose.translation.iter();
            bytes.extend(shift.flat_map(|value| value.to_le_bytes()));
            for turn in pose.rotations_f64() {
                let numbers = to_quaternion(&rodrigues(turn));
                let whole = numbers.map(|q| (q * f64::from(i16::MAX)).round() as i16);
                bytes.extend(whole.iter().flat_map(|value| value.to_le_bytes()));
            }
        }
        Ok(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_capture::skeleton::transform::compose;

    fn skeleton() -> Skeleton {
        Skeleton {
            names: vec!["root".into(), "head".into()],
            parents: vec![None, Some(0)],
            rest: vec![[0.0, 1.0, 0.0], [0.0, 1.6, 0.0]],
        }
    }

    fn clip(turns: &[[f32; 3]], translation: [f32; 3]) -> Clip {
        let pose = |turn: &[f32; 3]| {
            let mut pose = Pose::rest(2);
            pose.rotations[0] = *turn;
            pose.translation = translation;
            pose
        };
        Clip {
            poses: turns.iter().map(pose).collect(),
            ..Clip::rest(&skeleton())
        }
    }

    #[test]
    fn a_person_of_any_world_stands_on_the_origin_and_faces_z() {
        // A world with z up, and a person who faces x.
        let turn = [2.094_395_1 / 3f32.sqrt(); 3];
        let mut clip = clip(&[turn, turn], [3.0, -2.0, 5.0]);
        clip.up = [0.0, 0.0, 1.0];
        let to = clip.stand(&skeleton()).expect("a pose of hers");
        let joints = skeleton().world_transforms(&clip.poses[0]);
        let [root, head] = [&joints[0], &joints[1]].map(|joint| compose(&to, joint));
        for (joint, expected) in [(&root, [0.0, 0.0, 0.0]), (&head, [0.0, 0.6, 0.0])] {
            let off = length(sub(position(joint), expected));
            assert!(off < 1e-5, "{joint:?}");
        }
        let front = root.map(|row| row[2]);
        assert!(length(sub(front, [0.0, 0.0, 1.0])) < 1e-5, "{front:?}");
    }

    #[test]
    fn whoever_leans_stays_on_a_level_floor() {
        let mut walk = clip(&[[0.4, 0.0, 0.0]; 3], [0.0; 3]);
        for (at, pose) in walk.poses.iter_mut().enumerate() {
            pose.translation = [0.0, 0.0, at as f32];
        }
        let to = walk.stand(&skeleton()).expect("poses");
        let heights = walk.poses.iter().map(|pose| {
            let joints = skeleton().world_transforms(pose);
            position(&compose(&to, &joints[0]))[1]
        });
        for height in heights {
            assert!(height.abs() < 1e-9, "{height}");
        }
    }

    #[test]
    fn turns_without_a_mean_still_give_a_rigid_motion() {
        let pi = std::f32::consts::PI;
        for turns in [
            [[0.0; 3], [0.0, pi, 0.0]],
            [[0.0; 3], [pi, 0.0, 0.0]],
            [[0.0; 3], [0.0, 0.0, pi]],
        ] {
            let to = clip(&turns, [0.0; 3]).stand(&skeleton()).expect("poses");
            let rows = to.map(|[a, b, c, _]| [a, b, c]);
            for (i, row) in rows.iter().enumerate() {
                for (j, other) in rows.iter().enumerate() {
                    let expected = if i == j { 1.0 } else { 0.0 };
                    assert!((dot(*row, *other) - expected).abs() < 1e-6, "{to:?}");
                }
            }
        }
    }
}
