//! Volume rendering (paper eq. 9): α = (1 − exp(−σ δ)) m, C = Σ T α c, and background where
//! nothing was met. Transmittance is a sum of logarithms, whose gradient is finite where α = 1.

use super::march::Samples;
use burn::tensor::{IndexingUpdateOp, Int, Tensor, TensorData};

/// Keeps the logarithm finite where a sample is opaque (HumanNeRF).
const OPAQUE: f32 = 1e-10;

/// What rays see.
pub struct Composite {
    /// `[R, 3]`, over black.
    pub rgb: Tensor<2>,
    /// `[R]` opacity.
    pub alpha: Tensor<1>,
    /// `[R]` Σ T α z, not divided by opacity, metres.
    pub depth: Tensor<1>,
}

/// Composites live samples: `rgb` `[n, 3]`, `density` `[n]` 1/m, `likelihood` `[n]`.
pub fn composite(
    samples: &Samples,
    rgb: Tensor<2>,
    density: Tensor<1>,
    likelihood: Tensor<1>,
) -> Composite {
    let device = rgb.device();
    let (n, rays, per_ray) = (samples.live(), samples.rays, samples.per_ray);
    let floats =
        |values: &[f32]| Tensor::<1>::from_data(TensorData::new(values.to_vec(), [n]), &device);
    let places = Tensor::<1, Int>::from_data(samples.places.as_slice(), &device);
    let owners: Vec<i64> = samples
        .places
        .iter()
        .map(|place| place / per_ray as i64)
        .collect();
    let owners = Tensor::<1, Int>::from_data(owners.as_slice(), &device);

    let alpha = ((density * floats(&samples.steps)).neg().exp().neg() + 1.0) * likelihood;
    let grid = Tensor::<1>::zeros([rays * per_ray], &device).select_assign(
        0,
        places.clone(),
        alpha.clone(),
        IndexingUpdateOp::Add,
    );
    // In two sums: 1 + 1e-10 is 1 in f32, and the logarithm of an opaque sample would be −∞.
    let clear = (grid.reshape([rays, per_ray]).neg() + 1.0 + OPAQUE).log();
    // Exclusive: a sample is dimmed by those before it. Its own term is never part of the sum:
    // taking it off again would leave a rounding, which the gradient divides by 1 − α.
    let nothing = Tensor::<2>::zeros([rays, 1], &device);
    let earlier = clear.slice([0..rays, 0..per_ray - 1]);
    let before = Tensor::cat(vec![nothing, earlier.cumsum(1)], 1);
    let weight = before.reshape([rays * per_ray]).select(0, places).exp() * alpha;
    let sum = |values: Tensor<1>| {
        Tensor::<1>::zeros([rays], &device).select_assign(
            0,
            owners.clone(),
            values,
            IndexingUpdateOp::Add,
        )
    };
    let colour = Tensor::<2>::zeros([rays, 3], &device).select_assign(
        0,
        owners.clone(),
        rgb * weight.clone().unsqueeze_dim::<2>(1),
        IndexingUpdateOp::Add,
    );
    Composite {
        rgb: colour,
        alpha: sum(weight.clone()),
        depth: sum(weight * floats(&samples.depths)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;

    #[test]
    fn opaque_samples_hide_what_is_behind_and_keep_gradients_finite() {
        let device = Device::flex().autodiff();
        let samples = Samples {
            rays: 1,
            per_ray: 3,
            points: vec![0.0; 9],
            steps: vec![1.0; 3],
            depths: vec![1.0, 2.0, 3.0],
            places: vec![0, 1, 2],
        };
        let density = Tensor::<1>::from_floats([0.0, 1e10, 1e10], &device).require_grad();
        let rgb =
            Tensor::<2>::from_floats([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], &device);
        let seen = composite(&samples, rgb, density.clone(), Tensor::ones([3], &device));
        let colour: Vec<f32> = seen.rgb.clone().try_into_vec_as().expect("f32");
        // What is behind is dimmed to the 1e-10 that keeps the logarithm finite.
        assert!(
            colour[0] == 0.0 && colour[1] == 1.0 && colour[2] < 1e-9,
            "{colour:?}"
        );
        let grads = (seen.rgb.sum() + seen.depth.sum()).backward();
        let gradient: Vec<f32> = density
            .grad(&grads)
            .expect("tracked")
            .try_into_vec_as()
            .expect("f32");
        assert!(gradient.iter().all(|g| g.is_finite()), "{gradient:?}");
        assert!(
            gradient[0].abs() > 0.1,
            "the clear sample feels what it would hide"
        );
    }
}
