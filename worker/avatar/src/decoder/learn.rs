//! Learns a decoder from people who were filmed from every side. People count twice, once with left and right changed about. What a
//! person lacks is filled in by the decoder itself, again and again, as in iterated principal component analysis.

use super::cells::{CELLS, Means, mirrored};
use super::linear::Decoder;
use super::parts::{BodyPlace, Parts};
use faer::Mat;
use thiserror::Error;
use yoto_capture::skeleton::Skeleton;

/// Weight of a cell, opaque area, m², from which a person is known there.
const KNOWN: f32 = 1e-7;
/// Times that what is missing is filled in.
const ROUNDS: usize = 15;

/// Why there is no decoder.
#[derive(Debug, Error)]
pub enum LearnError {
    /// Too few people for the numbers of a code.
    #[error(
        "{people} people for codes of {rank} numbers: a decoder needs at least as many people as numbers"
    )]
    People {
        /// Number of people.
        people: usize,
        /// Numbers of a code.
        rank: usize,
    },
    /// The decomposition does not converge.
    #[error("the people's colours have no singular value decomposition")]
    Decomposition,
}

/// A person to learn from: splats in the rest pose.
pub struct ExamplePerson {
    pub(super) means: Means,
}

impl ExamplePerson {
    /// A person with a skeleton, of splats at `points`, metres, each with the joint that moves it, its colour and its
    /// opaque area, m². `None` if the skeleton has other joints than SMPL's.
    pub fn new(
        skeleton: &Skeleton,
        points: impl Iterator<Item = ([f32; 3], usize, [f32; 3], f32)>,
    ) -> Option<Self> {
        let parts = Parts::of(skeleton)?;
        let placed = points.map(|(at, joint, colour, area)| -> (BodyPlace, [f32; 3], f32) {
            (parts.place(at, joint), colour, area)
        });
        let means = Means::of(placed);
        Some(Self { means })
    }
}

impl Decoder {
    /// The decoder with codes of `rank` numbers that explains most of `people`.
    ///
    /// # Errors
    /// If there are too few people.
    pub fn learn(people: &[ExamplePerson], rank: usize) -> Result<Self, LearnError> {
        if people.len() < rank || rank == 0 {
            return Err(LearnError::People {
                people: people.len(),
                rank,
            });
        }
        let mirrored = mirrored();
        let mut rows: Vec<Vec<Option<[f32; 3]>>> = Vec::with_capacity(2 * people.len());
        for person in people {
            let known = |cell: usize| {
                (person.means.weights[cell] > KNOWN).then(|| person.means.colours[cell])
            };
            rows.push((0..CELLS).map(known).collect());
            rows.push(mirrored.iter().map(|cell| known(*cell)).collect());
        }
        let mean: Vec<[f32; 3]> = (0..CELLS).map(|cell| mean_at(&rows, cell)).collect();
        // Differences from the mean, `[P, 3 CELLS]`.
        let off = |row: usize, column: usize| -> Option<f64> {
            let (cell, c) = (column / 3, column % 3);
            rows[row][cell].map(|own| f64::from(own[c] - mean[cell][c]))
        };
        let (people, columns) = (rows.len(), 3 * CELLS);
        let mut filled = Mat::from_fn(people, columns, |r, c| off(r, c).unwrap_or(0.0));
        let mut scaled = filled.clone();
        for _ in 0..ROUNDS {
            let svd = filled.thin_svd().map_err(|_| LearnError::Decomposition)?;
            let (u, s, v) = (svd.U(), svd.S().column_vector(), svd.V());
            // People as the first singular vectors explain them.
            let left = Mat::from_fn(people, rank, |r, k| u[(r, k)] * s[k]);
            let explained = &left * v.subcols(0, rank).transpose();
            filled = Mat::from_fn(people, columns, |r, c| {
                off(r, c).unwrap_or(explained[(r, c)])
            });
            // Basis W = S Vᵀ / √P: codes of these people have a variance of 1.
            let root = (people as f64).sqrt();
            scaled = Mat::from_fn(rank, columns, |k, c| v[(c, k)] * s[k] / root);
        }
        let basis = |k: usize| -> Vec<[f32; 3]> {
            (0..CELLS)
                .map(|cell| std::array::from_fn(|c| scaled[(k, 3 * cell + c)] as f32))
                .collect()
        };
        Ok(Self {
            mean,
            basis: (0..rank).map(basis).collect(),
        })
    }
}

/// The mean of those who are known in a cell.
fn mean_at(rows: &[Vec<Option<[f32; 3]>>], cell: usize) -> [f32; 3] {
    let known = || rows.iter().filter_map(|row| row[cell]);
    let count = known().count().max(1) as f32;
    std::array::from_fn(|c| known().map(|colour| colour[c]).sum::<f32>() / count)
}
