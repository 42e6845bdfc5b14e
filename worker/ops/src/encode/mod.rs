//! Frequency (positional) encodings γ of points (NeRF, arXiv 2003.08934, eq. 4).

#[cfg(feature = "gpu")]
mod autodiff;
#[cfg(feature = "gpu")]
mod cube;
pub mod reference;

#[cfg(feature = "gpu")]
use burn::backend::tensor::FloatTensor;
#[cfg(feature = "gpu")]
use burn::backend::{Backend, Dispatch, backend_extension};
use burn::tensor::Tensor;

/// The bands that points are encoded in.
#[derive(Clone, Debug, PartialEq)]
pub struct Bands {
    /// Number of bands.
    pub count: usize,
    /// Angular frequency of the first band, radians per metre; each further band doubles it.
    pub unit: f32,
    /// Weight of each band; bands past the end of the list have weight 0. `None`: all bands have weight 1.
    pub window: Option<Vec<f32>>,
}

impl Bands {
    /// Bands of weight 1.
    pub fn new(count: usize, unit: f32) -> Self {
        Self {
            count,
            unit,
            window: None,
        }
    }

    /// Angular frequency, radians per metre, and weight of each band.
    pub fn each(&self) -> impl Iterator<Item = (f32, f32)> {
        let weight = |band| match &self.window {
            Some(window) => window.get(band).copied().unwrap_or(0.0),
            None => 1.0,
        };
        (0..self.count).map(move |band| ((1u64 << band.min(62)) as f32 * self.unit, weight(band)))
    }
}

/// The encoding as a backend implements it; CPUs run the reference. Call [`frequencies`] instead.
#[cfg(feature = "gpu")]
#[backend_extension(Autodiff, Cube, Fusion)]
pub trait EncodeOps: Backend {
    /// Forward of [`frequencies`].
    #[fusion(dtype = points, shape = output_shape(points, bands))]
    fn frequencies(points: FloatTensor<Self>, bands: Bands) -> FloatTensor<Self>;
    /// Gradient of [`frequencies`] to the points, from the encoded points.
    #[fusion(meta = |encoded, _, bands| {
        let mut to_points = encoded.clone();
        to_points.shape = points_shape(&encoded.shape, bands);
        to_points
    })]
    fn frequencies_backward(
        encoded: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        bands: Bands,
    ) -> FloatTensor<Self>;
}

/// w sin(ω x) and w cos(ω x) of `points` `[N, C]` for each band's angular frequency ω and weight w, band by band: sin
/// of all coordinates, then cos → `[N, 2 C bands]`. A GPU computes sines by a polynomial: Vulkan guarantees an error
/// of 2⁻¹¹ between −π and π and nothing beyond, where the angles of high bands are.
pub fn frequencies(points: Tensor<2>, bands: &Bands) -> Tensor<2> {
    #[cfg(feature = "gpu")]
    if super::on_gpu(&points.device()) {
        return Tensor::from_dispatch(Dispatch::frequencies(points.into_dispatch(), bands.clone()));
    }
    reference::frequencies(points, bands)
}

/// Shape of the encoding of `points` of this shape.
#[cfg(feature = "gpu")]
fn output_shape(points: &burn::tensor::Shape, bands: &Bands) -> burn::tensor::Shape {
    burn::tensor::Shape::new([points[0], 2 * points[1] * bands.count])
}

/// Shape of the points whose encoding has this shape.
#[cfg(feature = "gpu")]
fn points_shape(encoded: &burn::tensor::Shape, bands: &Bands) -> burn::tensor::Shape {
    burn::tensor::Shape::new([encoded[0], encoded[1] / (2 * bands.count).max(1)])
}
