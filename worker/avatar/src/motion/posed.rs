//! A body in a pose: the transforms from the posed body to the canonical box.
//!
//! All of it takes place in the body frame, in which the root has neither rotation nor
//! translation: they move the camera instead (HumanNeRF).

use super::body::CanonicalBody;
use burn::tensor::{Int, Tensor, TensorData};
use yoto_capture::camera::Pose;

/// Joints grouped by their distance from the root, for forward kinematics level by level.
fn levels(parents: &[Option<usize>]) -> Vec<Vec<usize>> {
    let mut depth = vec![0usize; parents.len()];
    let mut levels: Vec<Vec<usize>> = Vec::new();
    for (joint, parent) in parents.iter().enumerate() {
        depth[joint] = parent.map_or(0, |p| depth[p] + 1);
        if levels.len() <= depth[joint] {
            levels.push(Vec::new());
        }
        levels[depth[joint]].push(joint);
    }
    levels
}

/// The pose vector `[3 (K − 1)]`: rotations of all known joints except the root, axis-angle in radians.
pub fn pose_vector(body: &CanonicalBody, pose: &Pose) -> Tensor<1> {
    let known = pose.rotations.iter().take(body.known_joints);
    let values: Vec<f32> = known.skip(1).flatten().copied().collect();
    Tensor::from_data(
        TensorData::new(values.clone(), [values.len()]),
        &body.log_prior.device(),
    )
}

/// Positions of all known joints except the root, relative to it, in the body frame: `[K − 1, 3]`,
/// metres.
pub fn relative_joints(body: &CanonicalBody, pose: &Pose) -> Tensor<2> {
    let mut joints = body.skeleton.body_frame_joints(pose);
    joints.truncate(body.known_joints);
    let root = joints[0];
    let values: Vec<f32> = joints[1..]
        .iter()
        .flat_map(|j| (0..3).map(move |a| (j[a] - root[a]) as f32))
        .collect();
    Tensor::from_data(
        TensorData::new(values, [joints.len() - 1, 3]),
        &body.log_prior.device(),
    )
}

/// `[J, 12]`: G(rest) · G(pose)⁻¹ of each bone, row-major 3x4; J is K and the joints of fingers.
pub fn transforms(body: &CanonicalBody, pose: &Pose) -> Tensor<2> {
    let globals = body.skeleton.global_transforms(&pose.unrooted());
    let mut values = Vec::with_capacity(globals.len() * 12);
    for (g, rest) in globals.iter().zip(&body.rest) {
        for a in 0..3 {
            // Row a of Rᵀ, and −Rᵀ t + rest.
            let shift: f64 = (0..3).map(|c| g[c][a] * g[c][3]).sum();
            values.extend([
                g[0][a] as f32,
                g[1][a] as f32,
                g[2][a] as f32,
                (rest[a] - shift) as f32,
            ]);
        }
    }
    Tensor::from_data(
        TensorData::new(values, [globals.len(), 12]),
        &body.log_prior.device(),
    )
}

/// As [`transforms`], with each rotation except the root's followed by its `correction`
/// `[K − 1, 3, 3]`, to which gradients flow. Those of fingers are not corrected.
pub fn corrected_transforms(body: &CanonicalBody, pose: &Pose, correction: Tensor<3>) -> Tensor<2> {
    let device = body.log_prior.device();
    let joints = body.skeleton.parents.len();
    let locals: Vec<f32> = pose.unrooted()[1..]
        .iter()
        .flat_map(|r| {
            yoto_capture::skeleton::transform::rodrigues(*r)
                .into_iter()
                .flatten()
                .map(|v| v as f32)
        })
        .collect();
    let locals = Tensor::<3>::from_data(TensorData::new(locals, [joints - 1, 3, 3]), &device);
    let fingers = joints - body.known_joints;
    let correction = match fingers {
        0 => correction,
        _ => {
            let nothing = Tensor::<2>::eye(3, &device).unsqueeze::<3>();
            Tensor::cat(vec![correction, nothing.repeat_dim(0, fingers)], 0)
        }
    };
    // Inverse local rotations (R ΔR)ᵀ.
    chain(body, locals.matmul(correction).swap_dims(1, 2))
}

/// `[J, 12]`: G(rest) · G(pose)⁻¹ of each bone from the `inverse` `[J − 1, 3, 3]` of each local
/// rotation; the root has none.
pub(super) fn chain(body: &CanonicalBody, inverse: Tensor<3>) -> Tensor<2> {
    let device = body.log_prior.device();
    let parents = &body.skeleton.parents;
    let joints = parents.len();
    let parent_of = |joint: usize| parents[joint].expect("every joint but the root has a parent");
    let offset = |joint: usize, parent: usize| {
        let rest = &body.skeleton.rest;
        std::array::from_fn::<f32, 3, _>(|a| (rest[joint][a] - rest[parent][a]) as f32)
    };

    // G⁻¹ of a joint = L⁻¹ · G⁻¹ of its parent; L⁻¹ y = Rᵀ (y − t).
    let mut rotation = Tensor::<2>::eye(3, &device).unsqueeze::<3>();
    let root = body.skeleton.rest[0].map(|v| -v as f32);
    let mut shift = Tensor::<1>::from_floats(root, &device).reshape([1, 3, 1]);
    let mut order = vec![0usize];
    let (mut all_rotations, mut all_shifts) = (vec![rotation.clone()], vec![shift.clone()]);
    for level in levels(parents).into_iter().skip(1) {
        let previous_start = order.len() - rotation.dims()[0];
        let above: Vec<i64> = level
            .iter()
            .map(|&joint| {
                let parent = parent_of(joint);
                order[previous_start..]
                    .iter()
                    .position(|&o| o == parent)
                    .expect("a parent is one level above its child") as i64
            })
            .collect();
        let own: Vec<i64> = level.iter().map(|&joint| joint as i64 - 1).collect();
        let offsets: Vec<f32> = level
            .iter()
            .flat_map(|&joint| offset(joint, parent_of(joint)))
            .collect();
        let offsets =
            Tensor::<3>::from_data(TensorData::new(offsets, [level.len(), 3, 1]), &device);
        let above = Tensor::<1, Int>::from_data(above.as_slice(), &device);
        let local = inverse
            .clone()
            .select(0, Tensor::<1, Int>::from_data(own.as_slice(), &device));
        rotation = local.clone().matmul(rotation.select(0, above.clone()));
        shift = local.matmul(shift.select(0, above) - offsets);
        order.extend(level);
        all_rotations.push(rotation.clone());
        all_shifts.push(shift.clone());
    }
    // Back from level order to joint order.
    let mut rank = vec![0i64; joints];
    for (at, &joint) in order.iter().enumerate() {
        rank[joint] = at as i64;
    }
    let rank = Tensor::<1, Int>::from_data(rank.as_slice(), &device);
    let rest: Vec<f32> = body.rest.iter().flatten().map(|&v| v as f32).collect();
    let rest = Tensor::<3>::from_data(TensorData::new(rest, [joints, 3, 1]), &device);
    let rotation = Tensor::cat(all_rotations, 0).select(0, rank.clone());
    let shift = Tensor::cat(all_shifts, 0).select(0, rank) + rest;
    Tensor::cat(vec![rotation, shift], 2).reshape([joints, 12])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::ModelConfig;
    use burn::tensor::Device;
    use yoto_capture::skeleton::Skeleton;

    fn body(device: &Device) -> CanonicalBody {
        let skeleton = Skeleton {
            names: ["root", "a", "b", "c", "d"].map(String::from).to_vec(),
            parents: vec![None, Some(0), Some(1), Some(0), Some(2)],
            rest: vec![
                [0.1, 1.0, 0.0],
                [0.1, 0.5, 0.0],
                [0.1, 0.0, 0.2],
                [0.1, 1.5, 0.0],
                [0.3, -0.2, 0.2],
            ],
        };
        CanonicalBody::new(
            skeleton,
            &ModelConfig::named("draft", "yoto").expect("a tier"),
            device,
        )
    }

    fn pose() -> Pose {
        let rotations = (0..5)
            .map(|k| std::array::from_fn(|a| (k as f32 * 1.3 + a as f32 * 0.7).sin()))
            .collect();
        Pose {
            rotations,
            translation: [1.0, 2.0, 3.0],
        }
    }

    fn values(tensor: Tensor<2>) -> Vec<f32> {
        tensor.try_into_vec_as().expect("f32")
    }

    #[test]
    fn a_correction_by_nothing_changes_nothing() {
        let device = Device::flex();
        let (body, pose) = (body(&device), pose());
        let nothing = Tensor::<2>::eye(3, &device)
            .unsqueeze::<3>()
            .repeat_dim(0, 4);
        let (plain, corrected) = (
            values(transforms(&body, &pose)),
            values(corrected_transforms(&body, &pose, nothing)),
        );
        let worst = plain
            .iter()
            .zip(&corrected)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f32::max);
        assert!(worst < 1e-5, "{worst:e}");
    }

    #[test]
    fn posed_joints_go_back_to_their_rest_positions() {
        let device = Device::flex();
        let (body, pose) = (body(&device), pose());
        let joints = body.skeleton.body_frame_joints(&pose);
        for (bone, (t, joint)) in values(transforms(&body, &pose))
            .chunks_exact(12)
            .zip(joints)
            .enumerate()
        {
            for a in 0..3 {
                let back: f64 = (0..3)
                    .map(|c| f64::from(t[4 * a + c]) * joint[c])
                    .sum::<f64>()
                    + f64::from(t[4 * a + 3]);
                assert!(
                    (back - body.skeleton.rest[bone][a]).abs() < 1e-5,
                    "bone {bone}"
                );
            }
        }
    }
}
