//! The decoder: a mean colour and basis colours in each cell.

use super::cells::{CELLS, Means, around};
use super::parts::BodyPlace;
use faer::linalg::solvers::Solve;
use faer::{Mat, Side};
use yoto_proto::sha256_hex;

/// Variance of what a person has beyond the decoder, summed over the cells as the basis is: the code's prior is a
/// standard normal distribution (docs/research/splats.md, "What people share").
const NOISE: f64 = 1.0;
/// Weight of a cell, opaque area times evidence, m², at which it counts half.
const HALF: f32 = 1e-5;
/// Weight below which a cell does not count.
const NOTHING: f32 = 1e-7;

/// Hexadecimal digits of a digest.
const DIGEST: usize = 16;

/// A linear decoder of colours by places on the body and a person's code.
#[derive(Clone, Debug, PartialEq)]
pub struct Decoder {
    /// `[CELLS]` colours.
    pub(super) mean: Vec<[f32; 3]>,
    /// `[R, CELLS]` colours, for a code of R numbers.
    pub(super) basis: Vec<Vec<[f32; 3]>>,
}

/// The colours of one person by the decoder.
pub(crate) struct Decoded {
    /// `[CELLS]`.
    colours: Vec<[f32; 3]>,
}

impl Decoder {
    /// The beginning of the SHA-256 of its numbers, by which a model says what its guesses are from.
    pub(super) fn digest(&self) -> String {
        let all = std::iter::once(&self.mean).chain(&self.basis);
        let numbers = all.flat_map(|colours| colours.as_flattened());
        let bytes: Vec<u8> = numbers.flat_map(|number| number.to_le_bytes()).collect();
        sha256_hex(&bytes)[..DIGEST].to_owned()
    }

    /// The most likely appearance of a person who has `means` where frames show them.
    pub(crate) fn of_person(&self, means: &Means) -> Decoded {
        let seen: Vec<(usize, f64)> = (means.weights.iter().enumerate())
            .filter(|(_, weight)| **weight > NOTHING)
            .map(|(cell, weight)| (cell, f64::from(weight / (weight + HALF))))
            .collect();
        let rank = self.basis.len();
        // (W Wᵀ + NOISE I) z = W (c − μ), over the seen cells.
        let product = |a: &[[f32; 3]], b: &[[f32; 3]]| -> f64 {
            let of = |(cell, weight): &(usize, f64)| -> f64 {
                let (a, b) = (a[*cell], b[*cell]);
                weight
                    * (0..3)
                        .map(|c| f64::from(a[c]) * f64::from(b[c]))
                        .sum::<f64>()
            };
            seen.iter().map(of).sum()
        };
        let off: Vec<[f32; 3]> = (means.colours.iter().zip(&self.mean))
            .map(|(own, mean)| std::array::from_fn(|c| own[c] - mean[c]))
            .collect();
        let normal = Mat::from_fn(rank, rank, |r, c| {
            product(&self.basis[r], &self.basis[c]) + if r == c { NOISE } else { 0.0 }
        });
        let right = Mat::from_fn(rank, 1, |r, _| product(&self.basis[r], &off));
        let code = normal.llt(Side::Lower).map(|factor| factor.solve(&right));
        // Colours that are no numbers tell nothing: the mean person.
        let code: Vec<f64> = match code {
            Ok(code) if (0..rank).all(|r| code[(r, 0)].is_finite()) => {
                (0..rank).map(|r| code[(r, 0)]).collect()
            }
            _ => vec![0.0; rank],
        };
        self.decode(&code)
    }

    /// The person with this code.
    fn decode(&self, code: &[f64]) -> Decoded {
        let mut colours = self.mean.clone();
        for (z, basis) in code.iter().zip(&self.basis) {
            for (colour, basis) in colours.iter_mut().zip(basis) {
                for (own, basis) in colour.iter_mut().zip(basis) {
                    *own += *z as f32 * basis;
                }
            }
        }
        debug_assert_eq!(colours.len(), CELLS);
        Decoded { colours }
    }
}

impl Decoded {
    /// The colour at a place.
    pub(crate) fn colour(&self, place: BodyPlace) -> [f32; 3] {
        let mut sum = [0.0; 3];
        for (cell, share) in around(place) {
            for (sum, value) in sum.iter_mut().zip(self.colours[cell]) {
                *sum += share * value;
            }
        }
        sum
    }
}
