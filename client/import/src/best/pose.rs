//! A body's pose and view as a vector. The distance between two vectors says how much two frames differ.

use crate::geometry::{
    IDENTITY_ROTATION, Mat3, Vec3, dot, matmul, matvec, rodrigues, scale, sub, transpose,
};
use yoto_proto::pose_track::{Frame, Skeleton};

/// Weight of the view relative to the mean of all bones: rotating the body by an angle counts as much as rotating all
/// bones by it.
const VIEW: f64 = 1.0;

/// The direction of each joint from its parent in the root's frame, weighted so that all bones
/// together count for one, and the direction of the camera's view in the root's frame. The length
/// of the difference between two frames' features is about the angle between them, radians.
pub(super) fn features(skeleton: &Skeleton, frame: &Frame) -> Vec<f64> {
    let rotations = frame.pose.as_chunks::<3>().0;
    let rotation = |joint: usize| {
        rotations
            .get(joint)
            .map_or(IDENTITY_ROTATION, |&vector| rodrigues(vector))
    };
    let bones = skeleton.parents.len().saturating_sub(1).max(1) as f64;
    // Rotations of the joints so far, in the root's frame.
    let mut rotated: Vec<Mat3> = Vec::with_capacity(skeleton.parents.len());
    let mut features = Vec::with_capacity(3 * skeleton.parents.len());
    for (joint, &parent) in skeleton.parents.iter().enumerate() {
        let above = usize::try_from(parent).ok();
        let Some((above, above_rotation)) = above.and_then(|it| Some((it, *rotated.get(it)?)))
        else {
            rotated.push(IDENTITY_ROTATION);
            continue;
        };
        rotated.push(matmul(&above_rotation, &rotation(joint)));
        let rest = |joint: usize| skeleton.rest_joints.get(joint).copied().unwrap_or_default();
        let bone = matvec(&above_rotation, sub(rest(joint), rest(above)));
        features.extend(scale(unit(bone), bones.sqrt().recip()));
    }
    let [_, _, [x, y, z, _], _] = frame.e;
    let view = matvec(&transpose(&rotation(0)), [x, y, z]);
    features.extend(scale(view, VIEW));
    features
}

/// The direction of `v`; zero where it has none.
fn unit(v: Vec3) -> Vec3 {
    let length = dot(v, v).sqrt();
    if length > 1e-9 {
        scale(v, length.recip())
    } else {
        [0.0; 3]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, SQRT_2};

    fn skeleton() -> Skeleton {
        Skeleton {
            names: ["root", "knee", "foot"].map(String::from).to_vec(),
            parents: vec![-1, 0, 1],
            rest_joints: vec![[0.0; 3], [0.0, -0.4, 0.0], [0.0, -0.8, 0.0]],
        }
    }

    fn frame(root: Vec3, knee: Vec3, translation: Vec3) -> Frame {
        Frame {
            index: 0,
            pose: [root, knee, [0.0; 3]].concat(),
            translation,
            k: IDENTITY_ROTATION,
            e: std::array::from_fn(|i| std::array::from_fn(|j| f64::from(i == j))),
        }
    }

    fn apart(a: &Frame, b: &Frame) -> f64 {
        let (a, b) = (features(&skeleton(), a), features(&skeleton(), b));
        let squares = a.iter().zip(&b).map(|(a, b)| (a - b).powi(2));
        squares.sum::<f64>().sqrt()
    }

    #[test]
    fn bent_knees_and_turned_bodies_are_new_and_walks_are_not() {
        let still = frame([0.0; 3], [0.0; 3], [0.0; 3]);
        assert_eq!(
            apart(&still, &frame([0.0; 3], [0.0; 3], [3.0, 0.0, 1.0])),
            0.0
        );
        // One of two bones is off by a quarter turn, its direction by √2, over √2 bones.
        let bent = frame([0.0; 3], [FRAC_PI_2, 0.0, 0.0], [0.0; 3]);
        assert!((apart(&still, &bent) - 1.0).abs() < 1e-9);
        let rotated = frame([0.0, FRAC_PI_2, 0.0], [0.0; 3], [0.0; 3]);
        assert!((apart(&still, &rotated) - SQRT_2).abs() < 1e-9);
        // The camera goes round with the body: the same view of it.
        let mut followed = rotated.clone();
        let back = transpose(&rodrigues([0.0, FRAC_PI_2, 0.0]));
        for (row, rotation) in followed.e.iter_mut().zip(back) {
            row[..3].copy_from_slice(&rotation);
        }
        assert!(apart(&still, &followed) < 1e-9);
    }
}
