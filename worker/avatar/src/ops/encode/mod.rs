//! Frequency encodings γ of points.

#[cfg(feature = "gpu")]
pub(super) mod autodiff;
#[cfg(feature = "gpu")]
pub(super) mod cube;
pub mod reference;

use burn::tensor::Tensor;

/// The bands that points are encoded in.
#[derive(Clone, Debug, PartialEq)]
pub struct Bands {
    /// How many.
    pub count: usize,
    /// Radians a metre of the first; each further one has twice as many.
    pub unit: f32,
    /// Each band's weight; bands past its end have none. All are whole without one.
    pub window: Option<Vec<f32>>,
}

impl Bands {
    /// Bands of full weight.
    pub fn new(count: usize, unit: f32) -> Self {
        Self {
            count,
            unit,
            window: None,
        }
    }

    /// Radians a metre and weight of each.
    pub fn each(&self) -> impl Iterator<Item = (f32, f32)> {
        let weight = |band| match &self.window {
            Some(window) => window.get(band).copied().unwrap_or(0.0),
            None => 1.0,
        };
        (0..self.count).map(move |band| ((1u64 << band.min(62)) as f32 * self.unit, weight(band)))
    }
}

/// sin and cos of `points` `[N, C]` times each band's radians, times its weight, band by band: sin
/// of all coordinates, then cos → `[N, 2 C bands]`. On a GPU with sines of our own: Vulkan promises
/// 2⁻¹¹ between −π and π and nothing beyond, where high bands are.
pub fn frequencies(points: Tensor<2>, bands: &Bands) -> Tensor<2> {
    #[cfg(feature = "gpu")]
    if super::on_gpu(&points.device()) {
        return Tensor::from_dispatch(<burn::backend::Dispatch as super::GpuOps>::frequencies(
            points.into_dispatch(),
            bands.clone(),
        ));
    }
    reference::frequencies(points, bands)
}

/// Of the encoding of `points`.
#[cfg(feature = "gpu")]
pub(super) fn output_shape(points: &burn::tensor::Shape, bands: &Bands) -> burn::tensor::Shape {
    burn::tensor::Shape::new([points[0], 2 * points[1] * bands.count])
}

/// Of the points that `encoded` encodes.
#[cfg(feature = "gpu")]
pub(super) fn points_shape(encoded: &burn::tensor::Shape, bands: &Bands) -> burn::tensor::Shape {
    burn::tensor::Shape::new([encoded[0], encoded[1] / (2 * bands.count).max(1)])
}
