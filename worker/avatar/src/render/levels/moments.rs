//! The Gaussian in place of a group: weighted mean and covariance, colour and normal.

use super::LevelSplat;
use faer::{Mat, Side};
use yoto_capture::skeleton::transform::{
    IDENTITY_ROTATION, Mat3, cross, from_quaternion, to_quaternion,
};

/// Largest opacity: 1 has no logit.
const OPAQUE: f64 = 0.999;
/// Exponent by which the two largest deviations grow where a group covers more than an opaque splat of its size does; 1/2
/// would keep the coverage, and blur outlines (docs/research/splats-experiments.md).
const GROWTH: f64 = 0.25;
/// Smallest standard deviation, metres.
const THINNEST: f64 = 1e-6;

/// The Gaussian of a `group` of `splats`, and the weight of each member, which sum to 1.
pub(in crate::render) fn merged(splats: &[LevelSplat], group: &[usize]) -> (LevelSplat, Vec<f32>) {
    if let [only] = group {
        return (splats[*only], vec![1.0]);
    }
    let members = || group.iter().map(|index| &splats[*index]);
    let sum: f64 = members().map(LevelSplat::weight).sum();
    let weights: Vec<f64> = match sum > 0.0 {
        true => members().map(|it| it.weight() / sum).collect(),
        false => vec![1.0 / group.len() as f64; group.len()],
    };
    let mean_of = |of: &dyn Fn(&LevelSplat) -> [f64; 3]| -> [f64; 3] {
        let mut mean = [0.0; 3];
        for (weight, splat) in weights.iter().zip(members()) {
            for (mean, value) in mean.iter_mut().zip(of(splat)) {
                *mean += weight * value;
            }
        }
        mean
    };
    let mean = mean_of(&|it| it.mean.map(f64::from));
    let colour = mean_of(&|it| it.colour.map(f64::from));
    let normal = mean_of(&|it| from_quaternion(it.rotation.map(f64::from)).map(|row| row[2]));
    // Σ w (Σₖ + d dᵀ) with d from the common mean
    let mut covariance = [[0.0; 3]; 3];
    for (weight, splat) in weights.iter().zip(members()) {
        let axes = from_quaternion(splat.rotation.map(f64::from));
        let squares = splat.deviations.map(|d| f64::from(d) * f64::from(d));
        let d: [f64; 3] = std::array::from_fn(|a| f64::from(splat.mean[a]) - mean[a]);
        for (r, row) in covariance.iter_mut().enumerate() {
            for (c, entry) in row.iter_mut().enumerate() {
                let own: f64 = (0..3).map(|k| axes[r][k] * axes[c][k] * squares[k]).sum();
                *entry += weight * (own + d[r] * d[c]);
            }
        }
    }
    let (axes, deviations) = ellipsoid(&covariance, normal);
    let largest = members().zip(&weights).max_by(|a, b| a.1.total_cmp(b.1));
    let mut splat = LevelSplat {
        mean: mean.map(|v| v as f32),
        rotation: to_quaternion(&axes).map(|v| v as f32),
        deviations: deviations.map(|v| v as f32),
        opacity: 1.0,
        colour: colour.map(|v| v as f32),
        bone: largest.map_or(0, |(splat, _)| splat.bone),
    };
    let coverage = sum / splat.weight();
    if coverage > OPAQUE {
        let thinnest = (0..3).fold(0, |best, k| match deviations[k] < deviations[best] {
            true => k,
            false => best,
        });
        let wider = (coverage / OPAQUE).powf(GROWTH) as f32;
        let others = (0..3).filter(|k| *k != thinnest);
        others.for_each(|k| splat.deviations[k] *= wider);
    }
    splat.opacity = coverage.min(OPAQUE) as f32;
    (splat, weights.into_iter().map(|v| v as f32).collect())
}

/// Axes, column by column, and standard deviations of a covariance. The third axis is the one nearest to `normal`. Deviations
/// that can't be found are NaN, so that the splat is not drawn.
fn ellipsoid(covariance: &Mat3, normal: [f64; 3]) -> (Mat3, [f64; 3]) {
    let matrix = Mat::from_fn(3, 3, |r, c| covariance[r][c]);
    // A symmetric matrix of finite numbers always has eigenvectors.
    let Ok(found) = matrix.self_adjoint_eigen(Side::Lower) else {
        return (IDENTITY_ROTATION, [f64::NAN; 3]);
    };
    let vector = |k: usize| -> [f64; 3] { std::array::from_fn(|r| found.U()[(r, k)]) };
    let along = |k: usize| -> f64 { vector(k).iter().zip(normal).map(|(a, b)| a * b).sum() };
    let third = (0..3).fold(0, |best, k| match along(k).abs() > along(best).abs() {
        true => k,
        false => best,
    });
    let (first, second) = ((third + 1) % 3, (third + 2) % 3);
    let sign = if along(third) < 0.0 { -1.0 } else { 1.0 };
    let (a, c) = (vector(first), vector(third).map(|v| sign * v));
    // A rotation: the second axis is the product of the others.
    let b = cross(c, a);
    let deviation = |k: usize| found.S()[k].max(0.0).sqrt().max(THINNEST);
    (
        std::array::from_fn(|r| [a[r], b[r], c[r]]),
        [first, second, third].map(deviation),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn splat(mean: [f32; 3], colour: f32) -> LevelSplat {
        LevelSplat {
            mean,
            rotation: [1.0, 0.0, 0.0, 0.0],
            deviations: [0.01, 0.02, 0.001],
            opacity: 0.4,
            colour: [colour; 3],
            bone: 3,
        }
    }

    #[test]
    fn a_group_keeps_its_moments_and_its_coverage() {
        let splats = [splat([0.0; 3], 0.2), splat([0.03, 0.0, 0.0], 0.6)];
        let (found, weights) = merged(&splats, &[0, 1]);
        assert_eq!(weights, [0.5, 0.5]);
        let near = |found: [f32; 3], wanted: [f32; 3]| {
            let pairs = found.iter().zip(wanted);
            pairs.for_each(|(a, b)| assert!((a - b).abs() < 1e-6, "{found:?}, not {wanted:?}"));
        };
        near(found.mean, [0.015, 0.0, 0.0]);
        near(found.colour, [0.4; 3]);
        let axes = from_quaternion(found.rotation.map(f64::from));
        let variance = |r: usize| -> f64 {
            let squares = found.deviations.map(|d| f64::from(d).powi(2));
            (0..3).map(|k| axes[r][k].powi(2) * squares[k]).sum()
        };
        // 0.01² + 0.015²
        assert!((variance(0) - 3.25e-4).abs() < 1e-9, "{}", variance(0));
        assert!((variance(1) - 4e-4).abs() < 1e-9);
        assert!(axes[2][2] > 0.999, "the normal stays: {axes:?}");
        assert!((found.weight() - 2.0 * splats[0].weight()).abs() < 1e-9);
    }

    #[test]
    fn a_group_of_opaque_ones_is_opaque_and_has_a_logit() {
        let mut some = [splat([0.0; 3], 0.2); 5];
        some.iter_mut().for_each(|it| it.opacity = 0.99);
        let (found, _) = merged(&some, &[0, 1, 2, 3, 4]);
        assert!((found.opacity - 0.999).abs() < 1e-6, "{}", found.opacity);
        assert_eq!(found.mean, [0.0; 3]);
        // Five of 0.99 cover 4.95 times what one can.
        let wider = (4.95f32 / 0.999).powf(0.25);
        let mut wanted = [0.01 * wider, 0.02 * wider, 0.001];
        let mut deviations = found.deviations;
        wanted.sort_by(f32::total_cmp);
        deviations.sort_by(f32::total_cmp);
        let pairs = deviations.iter().zip(wanted);
        pairs.for_each(|(a, b)| assert!((a / b - 1.0).abs() < 1e-3, "{deviations:?}"));
    }
}
