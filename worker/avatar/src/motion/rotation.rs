//! Rotations from axis-angle vectors, finite with finite gradients at every angle.

use burn::tensor::Tensor;

/// Squared angle below which the series replaces the quotients: θ < 1e-3 rad.
const SERIES_BELOW: f32 = 1e-6;

/// `[K, 3]` radians → `[K, 3, 3]`: I + A \[r\]× + B \[r\]×², A = sin θ/θ, B = (1 − cos θ)/θ².
pub fn rodrigues(r: Tensor<2>) -> Tensor<3> {
    let [k, _] = r.dims();
    let device = r.device();
    let square = (r.clone() * r.clone()).sum_dim(1);
    let small = square.clone().lower_scalar(SERIES_BELOW);
    // Where the series is used, the quotients get an angle of 1, so that neither their values
    // nor their gradients are 0/0.
    let safe = square.clone().mask_fill(small.clone(), 1.0);
    let angle = safe.clone().sqrt();
    let half = (angle.clone() * 0.5).sin();
    let a = (angle.clone().sin() / angle).mask_where(small.clone(), square.clone() / -6.0 + 1.0);
    // 1 − cos θ = 2 sin²(θ/2) loses no digits at small angles.
    let b = (half.clone() * half * 2.0 / safe).mask_where(small, square.clone() / -24.0 + 0.5);
    let column = |i: usize| r.clone().slice([0..k, i..i + 1]);
    let (x, y, z) = (column(0), column(1), column(2));
    let zero = Tensor::<2>::zeros([k, 1], &device);
    let cross = Tensor::cat(
        vec![
            zero.clone(),
            z.clone().neg(),
            y.clone(),
            z,
            zero.clone(),
            x.clone().neg(),
            y.neg(),
            x,
            zero,
        ],
        1,
    )
    .reshape([k, 3, 3]);
    // [r]×² = r rᵀ − θ² I
    let outer = r.clone().reshape([k, 3, 1]).matmul(r.reshape([k, 1, 3]));
    let identity = Tensor::<2>::eye(3, &device).unsqueeze::<3>();
    let squared = outer - identity.clone() * square.reshape([k, 1, 1]);
    identity + cross * a.reshape([k, 1, 1]) + squared * b.reshape([k, 1, 1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;

    #[test]
    fn rotations_and_gradients_are_finite_at_every_angle() {
        let device = Device::flex().autodiff();
        for angle in [
            0.0,
            1e-8,
            1e-4,
            1e-3,
            1.0,
            std::f32::consts::PI,
            std::f32::consts::TAU,
            1e3,
        ] {
            let r = Tensor::<2>::from_floats([[angle * 0.6, angle * -0.8, 0.0]], &device)
                .require_grad();
            let rotation = rodrigues(r.clone());
            let values: Vec<f32> = rotation.clone().try_into_vec_as().expect("f32");
            // Orthonormal: R Rᵀ = I.
            for i in 0..3 {
                for j in 0..3 {
                    let dot: f32 = (0..3).map(|c| values[3 * i + c] * values[3 * j + c]).sum();
                    let expected = if i == j { 1.0 } else { 0.0 };
                    assert!((dot - expected).abs() < 1e-4, "angle {angle}: {values:?}");
                }
            }
            let gradient = r.grad(&rotation.sum().backward()).expect("tracked");
            let gradient: Vec<f32> = gradient.try_into_vec_as().expect("f32");
            assert!(
                gradient.iter().all(|g| g.is_finite()),
                "angle {angle}: {gradient:?}"
            );
        }
    }
}
