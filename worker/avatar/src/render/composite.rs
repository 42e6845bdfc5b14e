//! Compositing of marched samples (paper eq. 9), by
//! [`yoto_ops::composite`](mod@yoto_ops::composite).

use super::samples::Samples;
use burn::tensor::Tensor;
use yoto_ops::composite::{self, GradientSubsampling};

/// Colour, opacity and depth of rays.
pub struct Composite {
    /// `[R, 3]`, over black.
    pub rgb: Tensor<2>,
    /// `[R]` opacity.
    pub alpha: Tensor<1>,
    /// `[R]` Σ T α z, not divided by opacity, metres.
    pub depth: Tensor<1>,
}

/// Composites live samples: `rgb` `[n, 3]`, `density` `[n]` 1/m, `likelihood` `[n]`. Samples
/// behind a transmittance below `min_transmittance` have weight 0; with 0, all samples count.
/// Gradients flow to the samples that `subsampling` keeps, or to all without it.
pub fn composite(
    samples: &Samples,
    min_transmittance: f32,
    subsampling: Option<GradientSubsampling>,
    rgb: Tensor<2>,
    density: Tensor<1>,
    likelihood: Tensor<1>,
) -> Composite {
    let along = composite::RaySamples {
        starts: samples.starts().into(),
        steps: samples.steps.as_slice().into(),
        depths: samples.depths.as_slice().into(),
        min_transmittance,
        subsampling,
    };
    let rays = samples.rays;
    let seen = composite::composite(rgb, density, likelihood, &along);
    let column = |c: usize| seen.clone().slice([0..rays, c..c + 1]).reshape([rays]);
    Composite {
        rgb: seen.clone().slice([0..rays, 0..3]),
        alpha: column(3),
        depth: column(4),
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
            steps: vec![1.0; 3],
            depths: vec![1.0, 2.0, 3.0],
            places: vec![0, 1, 2],
            ..Samples::default()
        };
        let density = Tensor::<1>::from_floats([0.0, 1e10, 1e10], &device).require_grad();
        let rgb =
            Tensor::<2>::from_floats([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], &device);
        let likelihood = Tensor::ones([3], &device);
        let seen = composite(&samples, 0.0, None, rgb, density.clone(), likelihood);
        let colour: Vec<f32> = seen.rgb.clone().try_into_vec_as().expect("f32");
        // The hidden sample is weighted by the 1e-10 that keeps the transmittance above 0.
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
            "the clear sample has the gradient of what it would hide"
        );
    }
}
