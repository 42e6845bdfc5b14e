//! Compositing in Burn's own tensor operations, which the tests compare the other forms with.
//! Transmittance is a sum of logarithms, whose gradient is finite where α = 1.

use super::{OPAQUE, RaySamples};
use burn::tensor::{IndexingUpdateOp, Int, Tensor, TensorData};

/// See [`super::composite`].
pub fn composite(
    rgb: Tensor<2>,
    density: Tensor<1>,
    likelihood: Tensor<1>,
    samples: &RaySamples,
) -> Tensor<2> {
    let device = rgb.device();
    let (n, rays) = (samples.steps.len(), samples.rays());
    let counts = samples.starts.windows(2).map(|pair| pair[1] - pair[0]);
    // One more than the longest ray has: the last entry of a row is always empty.
    let per_ray = counts.max().unwrap_or(0) + 1;
    let mut owners = Vec::with_capacity(n);
    let mut indices = Vec::with_capacity(n);
    for (ray, pair) in samples.starts.windows(2).enumerate() {
        owners.extend((pair[0]..pair[1]).map(|_| ray as i64));
        indices.extend((pair[0]..pair[1]).map(|i| (ray * per_ray + i - pair[0]) as i64));
    }
    let floats =
        |values: &[f32]| Tensor::<1>::from_data(TensorData::new(values.to_vec(), [n]), &device);
    let indices = Tensor::<1, Int>::from_data(indices.as_slice(), &device);
    let owners = Tensor::<1, Int>::from_data(owners.as_slice(), &device);

    let alpha = ((density * floats(&samples.steps)).neg().exp().neg() + 1.0) * likelihood;
    let grid = Tensor::<1>::zeros([rays * per_ray], &device).select_assign(
        0,
        indices.clone(),
        alpha.clone(),
        IndexingUpdateOp::Add,
    );
    // log(1 − α + 1e-10), in this order: 1 + 1e-10 is 1 in f32, and the logarithm of an opaque sample would be −∞.
    let log_passed = (grid.reshape([rays, per_ray]).neg() + 1.0 + OPAQUE).log();
    // log T, an exclusive sum over the samples in front. The sample's own term is never part of it: subtracting it
    // again would leave a rounding error, which the gradient divides by 1 − α.
    let nothing = Tensor::<2>::zeros([rays, 1], &device);
    let earlier = log_passed.slice([0..rays, 0..per_ray - 1]);
    let before = Tensor::cat(vec![nothing, earlier.cumsum(1)], 1);
    let mut transmittance = before.reshape([rays * per_ray]).select(0, indices).exp();
    if samples.min_transmittance > 0.0 {
        let kept = transmittance
            .clone()
            .detach()
            .greater_equal_scalar(samples.min_transmittance);
        transmittance = transmittance * kept.float();
    }
    let weight = (transmittance * alpha).unsqueeze_dim::<2>(1);
    let values = Tensor::cat(
        vec![
            rgb,
            Tensor::ones([n, 1], &device),
            floats(&samples.depths).unsqueeze_dim::<2>(1),
        ],
        1,
    );
    Tensor::<2>::zeros([rays, 5], &device).select_assign(
        0,
        owners,
        values * weight,
        IndexingUpdateOp::Add,
    )
}
