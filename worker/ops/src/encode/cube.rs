//! The encoding on a GPU: a thread per coordinate and band.

use super::{Bands, EncodeOps};
use crate::cube::tensors::{each, empty, rows, upload};
use burn::backend::tensor::FloatTensor;
use burn_cubecl::CubeBackend;
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;

impl EncodeOps for CubeBackend {
    fn frequencies(points: FloatTensor<Self>, bands: Bands) -> FloatTensor<Self> {
        forward(points, &bands)
    }

    fn frequencies_backward(
        encoded: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        bands: Bands,
    ) -> FloatTensor<Self> {
        backward(encoded, grad, &bands)
    }
}

/// Multiples of π/2 per radian.
const QUARTERS: f32 = std::f32::consts::FRAC_2_PI;
/// π/2 in three parts (Cephes). The first two have so few significant bits that their products with multiples up to
/// [`LARGEST`] · [`QUARTERS`] are exact.
const HIGH: f32 = 1.570_312_5;
const MIDDLE: f32 = 4.837_513e-4;
const LOW: f32 = 7.549_79e-8;
/// Larger angles, radians, are left to the driver's functions; up to this one, the error of the reduced angle is
/// 1e-7.
const LARGEST: f32 = 8192.0;

/// `[N, 2 C bands]` as in [`super::frequencies`].
fn forward(points: CubeTensor, bands: &Bands) -> CubeTensor {
    let points = rows(points);
    let encoded = empty(&points, super::output_shape(points.meta.shape(), bands));
    let client = points.client.clone();
    let coordinates = points.meta.shape()[1];
    let threads = points.meta.num_elements() * bands.count;
    if threads > 0 {
        let (count, dim) = each(&client, threads);
        encode_points::launch(
            &client,
            count,
            dim,
            points.into_buffer_arg(),
            upload(&client, &numbers(bands)),
            encoded.clone().into_buffer_arg(),
            coordinates,
        );
    }
    encoded
}

/// Gradient to the points `[N, C]`, from the encoded points and the gradient to them, both
/// `[N, 2 C bands]`.
fn backward(encoded: CubeTensor, grad: CubeTensor, bands: &Bands) -> CubeTensor {
    let (encoded, grad) = (rows(encoded), rows(grad));
    let shape = super::points_shape(encoded.meta.shape(), bands);
    let (coordinates, threads) = (shape[1], shape.num_elements());
    let to_points = empty(&encoded, shape);
    let client = encoded.client.clone();
    if threads > 0 {
        let (count, dim) = each(&client, threads);
        points_backward::launch(
            &client,
            count,
            dim,
            encoded.into_buffer_arg(),
            grad.into_buffer_arg(),
            upload(&client, &numbers(bands)),
            to_points.clone().into_buffer_arg(),
            coordinates,
        );
    }
    to_points
}

/// Angular frequency, radians per metre, and weight of each band, one after the other.
fn numbers(bands: &Bands) -> Vec<f32> {
    bands
        .each()
        .flat_map(|(radians, weight)| [radians, weight])
        .collect()
}

#[derive(CubeType, Clone, Copy)]
struct SinCos {
    sine: f32,
    cosine: f32,
}

/// Sine and cosine of an angle in radians, with errors of at most 2e-7: a multiple of π/2 is subtracted, and
/// polynomials are evaluated at the rest (Cody and Waite's reduction).
#[cube]
fn sin_cos(angle: f32) -> SinCos {
    let quarters = f32::round(angle * QUARTERS);
    let r = angle - quarters * HIGH - quarters * MIDDLE - quarters * LOW;
    let s = r * r;
    // Minimax polynomials on ±π/4 (Cephes).
    let sine = r - r * s * (1.666_665_5e-1 - s * (8.332_161e-3 - s * 1.951_529_6e-4));
    let cosine = 1.0 - s * (0.5 - s * (4.166_664_6e-2 - s * (1.388_731_6e-3 - s * 2.443_315_7e-5)));
    let quarter = i32::cast_from(quarters) & 3;
    let mut sin_cos = SinCos { sine, cosine };
    if quarter == 1 {
        sin_cos.sine = cosine;
        sin_cos.cosine = -sine;
    }
    if quarter == 2 {
        sin_cos.sine = -sine;
        sin_cos.cosine = -cosine;
    }
    if quarter == 3 {
        sin_cos.sine = -cosine;
        sin_cos.cosine = sine;
    }
    if f32::abs(angle) > LARGEST {
        sin_cos.sine = f32::sin(angle);
        sin_cos.cosine = f32::cos(angle);
    }
    sin_cos
}

/// Writes sin(ω x) w and cos(ω x) w of each coordinate x and band (ω, w).
#[cube(launch)]
fn encode_points(
    points: &[f32],
    bands: &[f32],
    encoded: &mut [f32],
    #[comptime] coordinates: usize,
) {
    let count = bands.len() / 2;
    if ABSOLUTE_POS >= points.len() * count {
        terminate!();
    }
    let band = ABSOLUTE_POS / coordinates % count;
    let i = ABSOLUTE_POS / (coordinates * count);
    let c = ABSOLUTE_POS % coordinates;
    let sin_cos = sin_cos(points[i * coordinates + c] * bands[2 * band]);
    let weight = bands[2 * band + 1];
    let to = 2 * coordinates * (i * count + band) + c;
    encoded[to] = sin_cos.sine * weight;
    encoded[to + coordinates] = sin_cos.cosine * weight;
}

/// Writes the gradient to the points: Σ ω (∂L/∂sin cos(ω x) − ∂L/∂cos sin(ω x)) w over the bands.
#[cube(launch)]
fn points_backward(
    encoded: &[f32],
    grad: &[f32],
    bands: &[f32],
    to_points: &mut [f32],
    #[comptime] coordinates: usize,
) {
    let count = bands.len() / 2;
    if ABSOLUTE_POS >= to_points.len() {
        terminate!();
    }
    let i = ABSOLUTE_POS / coordinates;
    let c = ABSOLUTE_POS % coordinates;
    let mut sum = 0.0f32;
    for band in 0..count {
        // The weight is in the encoded values already.
        let sine = 2 * coordinates * (i * count + band) + c;
        let cosine = sine + coordinates;
        sum += bands[2 * band] * (encoded[cosine] * grad[sine] - encoded[sine] * grad[cosine]);
    }
    to_points[ABSOLUTE_POS] = sum;
}
