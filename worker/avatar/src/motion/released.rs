//! Bone transforms as the released HumanNeRF program computes them (`numerics = "reference"`).
//!
//! Its rotations are not exactly orthonormal, since two different guards against a division by
//! zero shorten the axis. They are therefore inverted as general matrices.

use super::body::CanonicalBody;
use super::posed::chain;
use burn::tensor::{Tensor, TensorData};
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::Vec3;
use yoto_ops::cofactors::inverse;

/// Added to each number of the pose vector before any network sees it.
pub(crate) const POSE_SHIFT: f32 = 1e-2;
/// Added to the angle in the division that gives a pose's axis.
const AXIS_GUARD: f64 = 1e-5;
/// Added to the squared angle of a correction.
const ANGLE_GUARD: f32 = 1e-5;

/// Rotations of corrections `[K, 3]` radians → `[K, 3, 3]`, by θ = √(1e-5 + |v|²).
pub(crate) fn rodrigues(r: Tensor<2>) -> Tensor<3> {
    let angle = ((r.clone() * r.clone()).sum_dim(1) + ANGLE_GUARD).sqrt();
    about(r / angle.clone(), angle)
}

/// Axis v / (|v| + 1e-5) and angle of a pose's local rotation.
fn local(v: Vec3) -> ([f32; 3], f32) {
    let angle = v.iter().map(|c| c * c).sum::<f64>().sqrt();
    (v.map(|c| (c / (angle + AXIS_GUARD)) as f32), angle as f32)
}

/// cos θ I + sin θ \[r\]× + (1 − cos θ) r rᵀ for `axis` `[K, 3]` and `angle` `[K, 1]`.
fn about(axis: Tensor<2>, angle: Tensor<2>) -> Tensor<3> {
    let [k, _] = axis.dims();
    let device = axis.device();
    let column = |i: usize| axis.clone().slice([0..k, i..i + 1]);
    let (x, y, z) = (column(0), column(1), column(2));
    let zero = Tensor::<2>::zeros([k, 1], &device);
    let rows = vec![
        zero.clone(),
        z.clone().neg(),
        y.clone(),
        z,
        zero.clone(),
        x.clone().neg(),
        y.neg(),
        x,
        zero,
    ];
    let cross = Tensor::cat(rows, 1).reshape([k, 3, 3]);
    let outer = axis
        .clone()
        .reshape([k, 3, 1])
        .matmul(axis.reshape([k, 1, 3]));
    let (sine, cosine) = (angle.clone().sin(), angle.cos());
    let identity = Tensor::<2>::eye(3, &device).unsqueeze::<3>();
    let spread = cosine.clone().neg() + 1.0;
    identity * cosine.reshape([k, 1, 1])
        + cross * sine.reshape([k, 1, 1])
        + outer * spread.reshape([k, 1, 1])
}

/// `[K, 12]`: posed body to canonical, of each bone, row-major 3x4. `correction`
/// `[K − 1, 3, 3]` follows each local rotation except the root's.
pub(crate) fn transforms(
    body: &CanonicalBody,
    pose: &Pose,
    correction: Option<Tensor<3>>,
) -> Tensor<2> {
    let device = body.log_prior.device();
    let (axes, angles): (Vec<[f32; 3]>, Vec<f32>) =
        pose.unrooted().into_iter().skip(1).map(local).unzip();
    let bones = angles.len();
    let axes = TensorData::new(axes.as_flattened().to_vec(), [bones, 3]);
    let mut locals = about(
        Tensor::from_data(axes, &device),
        Tensor::from_data(TensorData::new(angles, [bones, 1]), &device),
    );
    if let Some(correction) = correction {
        locals = locals.matmul(correction);
    }
    let (inverse, _) = inverse(locals);
    chain(body, inverse)
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;

    #[test]
    fn large_angles_agree_with_exact_rotations_to_the_guard() {
        let vector = [0.3, -0.7, 0.5];
        let device = Device::flex();
        let released: Vec<f32> = rodrigues(Tensor::<2>::from_floats([vector], &device))
            .reshape([9])
            .try_into_vec_as()
            .expect("f32");
        let exact = yoto_capture::skeleton::transform::rodrigues(vector.map(f64::from));
        for (a, b) in released.iter().zip(exact.as_flattened()) {
            assert!((f64::from(*a) - b).abs() < 2e-5);
        }
    }
}
