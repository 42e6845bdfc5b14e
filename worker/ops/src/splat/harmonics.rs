//! View-dependent colours: a splat's colour plus Σ cₖ Yₖ(v), where v is the unit direction from the camera to the
//! splat in the canonical frame, and Yₖ are the real spherical harmonics of degree 1 and 2 with the signs and the
//! order of 3D Gaussian splatting (`utils/sh_utils.py` there). Files have the same frame: there, a person in the
//! rest pose has the same coefficients.
//!
//! No gradients flow to directions: a splat should move to where it is seen, not to where its colour fits.

use super::row::{COLOUR, MEAN};
use super::{ROW, Splats, View};
use burn::tensor::Tensor;
use rayon::prelude::*;

/// Number of harmonics above degree 0, up to degree 2.
pub const HARMONICS: usize = 8;

/// Splats per task.
const BLOCK: usize = 1024;

/// Normalisation factors of [`terms`].
const FACTORS: [f32; HARMONICS] = [
    -0.488_602_5,
    0.488_602_5,
    -0.488_602_5,
    1.092_548_4,
    -1.092_548_4,
    0.315_391_57,
    -1.092_548_4,
    0.546_274_2,
];

/// Number of harmonics from degree 1 up to `degree`, which is 0, 1 or 2.
pub const fn count(degree: usize) -> usize {
    (degree + 1) * (degree + 1) - 1
}

/// The highest degree of `count` harmonics from degree 1 up.
pub const fn degree(count: usize) -> usize {
    (count + 1).isqrt() - 1
}

/// The harmonics Yₖ of degree 1 and 2 at a unit direction.
#[inline(always)]
pub fn terms([x, y, z]: [f32; 3]) -> [f32; HARMONICS] {
    let plain = [
        y,
        z,
        x,
        x * y,
        y * z,
        2.0 * z * z - x * x - y * y,
        x * z,
        x * x - y * y,
    ];
    std::array::from_fn(|k| FACTORS[k] * plain[k])
}

impl View {
    /// The camera's centre in the frame of the body, −Eᵀ t, metres.
    fn centre(&self) -> [f32; 3] {
        std::array::from_fn(|c| -(0..3).map(|r| self.e[r][c] * self.e[r][3]).sum::<f32>())
    }
}

impl Splats {
    /// The splats with the colours that the camera of `view` sees, which no longer depend on the view.
    pub fn with_view_colours(mut self, view: &View) -> Self {
        let Some(harmonics) = self.harmonics.take() else {
            return self;
        };
        let [_, numbers] = harmonics.dims();
        let t = self.transforms.clone().detach();
        let entry = |r: usize, c: usize| t.clone().narrow(1, 4 * r + c, 1);
        let mean = self.means.clone().detach();
        let eye = view.centre();
        // v = Aᵀ (A μ + t − eye), normalised
        let direction: [Tensor<2>; 3] = std::array::from_fn(|r| {
            let along = |c: usize| entry(r, c) * mean.clone().narrow(1, c, 1);
            along(0) + along(1) + along(2) + entry(r, 3) - eye[r]
        });
        let [x, y, z]: [Tensor<2>; 3] = std::array::from_fn(|c| {
            let along = |r: usize| entry(r, c) * direction[r].clone();
            along(0) + along(1) + along(2)
        });
        let square = |v: &Tensor<2>| v.clone() * v.clone();
        let length = (square(&x) + square(&y) + square(&z))
            .sqrt()
            .clamp_min(f32::MIN_POSITIVE);
        // Splats at means that are not finite are not rendered and must not get gradients of NaN.
        let [x, y, z] = [x, y, z].map(|v| {
            let part = v / length.clone();
            part.clone().mask_fill(part.is_nan(), 0.0)
        });
        let plain = [
            y.clone(),
            z.clone(),
            x.clone(),
            x.clone() * y.clone(),
            y.clone() * z.clone(),
            square(&z) * 2.0 - square(&x) - square(&y),
            x.clone() * z,
            square(&x) - square(&y),
        ];
        let terms = plain.into_iter().zip(FACTORS).take(numbers / 3);
        for (k, (term, factor)) in terms.enumerate() {
            self.colours = self.colours + harmonics.clone().narrow(1, 3 * k, 3) * (term * factor);
        }
        self
    }
}

/// Adds the view-dependent colours of `harmonics` `[N, K, 3]` to the colours in `rows` `[N, 14]`: the counterpart
/// of [`Splats::with_view_colours`] in host memory. `transforms` has shape `[N, 12]`.
pub fn add_view_colours(rows: &mut [f32], harmonics: &[f32], transforms: &[f32], view: &View) {
    let rows = rows.as_chunks_mut::<ROW>().0;
    let numbers = harmonics.len() / rows.len().max(1);
    let eye = view.centre();
    let splats = rows.par_iter_mut().with_min_len(BLOCK);
    let splats = splats.zip(harmonics.par_chunks_exact(numbers.max(1)));
    let splats = splats.zip(transforms.as_chunks::<12>().0);
    splats.for_each(|((row, harmonics), t)| {
        // v = Aᵀ (A μ + t − eye), normalised
        let [x, y, z] = [row[MEAN], row[MEAN + 1], row[MEAN + 2]];
        let direction: [f32; 3] = std::array::from_fn(|r| {
            t[4 * r] * x + t[4 * r + 1] * y + t[4 * r + 2] * z + t[4 * r + 3] - eye[r]
        });
        let canonical: [f32; 3] = std::array::from_fn(|c| {
            t[c] * direction[0] + t[4 + c] * direction[1] + t[8 + c] * direction[2]
        });
        let length = canonical.iter().map(|v| v * v).sum::<f32>().sqrt();
        let terms = terms(canonical.map(|v| v / length.max(f32::MIN_POSITIVE)));
        for (term, own) in terms.iter().zip(harmonics.as_chunks::<3>().0) {
            for c in 0..3 {
                row[COLOUR + c] += term * own[c];
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::splat::light::LIGHTS;
    use burn::tensor::{Device, TensorData};

    #[test]
    fn harmonics_are_orthonormal_over_the_sphere() {
        // The corners of an icosahedron integrate polynomials of degree 5 exactly.
        let golden = (1.0 + 5f32.sqrt()) / 2.0;
        let mut corners = Vec::new();
        for a in [1.0, -1.0] {
            for b in [golden, -golden] {
                corners.extend([[0.0, a, b], [a, b, 0.0], [b, 0.0, a]]);
            }
        }
        let length = (1.0 + golden * golden).sqrt();
        for one in 0..HARMONICS {
            for other in 0..HARMONICS {
                let sum: f32 = (corners.iter())
                    .map(|corner| terms(corner.map(|v| v / length)))
                    .map(|terms| terms[one] * terms[other])
                    .sum();
                let wanted = if one == other { 1.0 } else { 0.0 };
                let found = sum * 4.0 * std::f32::consts::PI / 12.0;
                assert!((found - wanted).abs() < 1e-5, "{one} {other}: {found}");
            }
        }
        assert_eq!([1, 2].map(count), [3, 8]);
        assert_eq!([0, 3, 8].map(degree), [0, 1, 2]);
    }

    /// The camera stands 2 m from a splat that its bone has rotated by 90° about y, from z to x.
    #[test]
    fn view_colours_rotate_with_the_bones() {
        let device = Device::flex();
        let matrix = |values: &[f32], columns: usize| {
            let shape = [values.len() / columns, columns];
            Tensor::<2>::from_data(TensorData::new(values.to_vec(), shape), &device)
        };
        let transform = [0.0, 0.0, 1.0, 0.3, 0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0];
        let mut own = [0.0; 24];
        // Of z, green; of x², blue.
        own[3 + 1] = 1.0;
        own[3 * 7 + 2] = 2.0;
        let splats = Splats {
            transforms: matrix(&transform, 12),
            means: matrix(&[0.1, 0.0, 0.0], 3),
            rotations: matrix(&[1.0, 0.0, 0.0, 0.0], 4),
            scales: matrix(&[-3.0; 3], 3),
            opacities: Tensor::zeros([1], &device),
            colours: matrix(&[0.5; 3], 3),
            harmonics: Some(matrix(&own, 24)),
            light: Tensor::zeros([3, LIGHTS], &device),
        };
        // The splat is at (0.3, 0, −0.1); the camera at (−1.7, 0, −0.1) looks along x.
        let view = View {
            width: 8,
            height: 8,
            k: [[8.0, 0.0, 4.0], [0.0, 8.0, 4.0]],
            e: [
                [0.0, 0.0, -1.0, -0.1],
                [0.0, 1.0, 0.0, 0.0],
                [1.0, 0.0, 0.0, 1.7],
            ],
            world: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        };
        // x of the world is z of the rest pose.
        let along = terms([0.0, 0.0, 1.0]);
        let wanted = [0.5, 0.5 + along[1], 0.5 + 2.0 * along[7]];
        let mut rows: Vec<f32> = splats.rows().try_into_vec_as().expect("f32");
        add_view_colours(&mut rows, &own, &transform, &view);
        let seen: Vec<f32> = splats
            .with_view_colours(&view)
            .colours
            .try_into_vec_as()
            .expect("f32");
        for c in 0..3 {
            assert!((seen[c] - wanted[c]).abs() < 1e-5, "{seen:?} {wanted:?}");
            assert!((rows[COLOUR + c] - wanted[c]).abs() < 1e-5, "{rows:?}");
        }
    }
}
