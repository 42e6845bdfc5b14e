//! Cholesky factorisation of the normal equations.
//!
//! Each frame is coupled to the next two, so frames are factored one after the other, in time and memory
//! proportional to their number. The border of shared unknowns is carried along as further right-hand
//! sides, and leaves a small dense system: the Schur complement.

use crate::joints::UNKNOWNS;
use crate::normal::{FrameBlock, Normal};
use faer::linalg::triangular_solve::{
    solve_lower_triangular_in_place, solve_upper_triangular_in_place,
};
use faer::prelude::Solve;
use faer::{Mat, Par, Side};
use yoto_capture::skeleton::transform::Mat3;

/// A step of all unknowns.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    /// `[frames][UNKNOWNS]`.
    pub frames: Vec<Vec<f64>>,
    pub shared: Vec<f64>,
}

/// A factored frame.
struct Factor {
    /// Lower triangle.
    own: Mat<f64>,
    /// The factor's blocks in the rows of the next frame and of the frame after, transposed.
    ahead: [Mat<f64>; 2],
    /// The border after forward substitution.
    border: Mat<f64>,
}

/// The solution of `normal` with the diagonal increased by the share `damping`; `None` if the matrix is not
/// positive definite.
pub(crate) fn solve(normal: &Normal, damping: f64) -> Option<Step> {
    let mut factors: Vec<Factor> = Vec::with_capacity(normal.blocks.len());
    let unknowns = normal.slope.len();
    let mut shared = normal.shared.clone();
    let mut slope = Mat::from_fn(unknowns, 1, |row, _| -normal.slope[row]);
    for row in 0..unknowns {
        shared[(row, row)] += damping * shared[(row, row)] + 1e-9;
    }
    for block in &normal.blocks {
        let factor = factor(block, &factors, damping)?;
        let (pull, coupling) = factor.border.as_ref().split_at_col(1);
        shared -= coupling.transpose() * coupling;
        slope -= coupling.transpose() * pull;
        factors.push(factor);
    }
    let shared = solve_shared(shared, slope, &normal.held)?;
    let mut frames: Vec<Mat<f64>> = Vec::with_capacity(factors.len());
    for factor in factors.iter().rev() {
        let (pull, coupling) = factor.border.as_ref().split_at_col(1);
        let mut right = pull - coupling * &shared;
        // The frames after this one are solved already; the next one was pushed last.
        for (ahead, later) in factor.ahead.iter().zip(frames.iter().rev()) {
            right -= ahead * later;
        }
        solve_upper_triangular_in_place(factor.own.transpose(), right.as_mut(), Par::Seq);
        frames.push(right);
    }
    let list = |m: &Mat<f64>| -> Vec<f64> { m.col(0).iter().copied().collect() };
    let step = Step {
        frames: frames.iter().rev().map(list).collect(),
        shared: list(&shared),
    };
    let finite = |values: &Vec<f64>| values.iter().all(|value| value.is_finite());
    (finite(&step.shared) && step.frames.iter().all(finite)).then_some(step)
}

/// Factors the block of a frame; `before` are the factors of all earlier frames.
fn factor(block: &FrameBlock, before: &[Factor], damping: f64) -> Option<Factor> {
    let mut own = block.own.clone();
    for row in 0..UNKNOWNS {
        own[(row, row)] += damping * own[(row, row)] + 1e-9;
    }
    let mut border = Mat::from_fn(UNKNOWNS, block.border.ncols(), |row, column| {
        let value = block.border[(row, column)];
        if column == 0 { -value } else { value }
    });
    let mut ahead = [0, 1].map(|at| from_triples(&block.ahead[at]));
    let mut earlier = before.iter().rev();
    if let Some(last) = earlier.next() {
        own -= last.ahead[0].transpose() * &last.ahead[0];
        border -= last.ahead[0].transpose() * &last.border;
        ahead[0] -= last.ahead[0].transpose() * &last.ahead[1];
    }
    if let Some(second) = earlier.next() {
        own -= second.ahead[1].transpose() * &second.ahead[1];
        border -= second.ahead[1].transpose() * &second.border;
    }
    let own = own.llt(Side::Lower).ok()?.L().to_owned();
    for right in ahead.iter_mut().chain([&mut border]) {
        solve_lower_triangular_in_place(own.as_ref(), right.as_mut(), Par::Seq);
    }
    Some(Factor { own, ahead, border })
}

/// Triples as a block diagonal matrix, transposed: rows are of the frame, columns of the later frame.
fn from_triples(triples: &[Mat3]) -> Mat<f64> {
    let mut matrix = Mat::zeros(UNKNOWNS, UNKNOWNS);
    for (at, triple) in triples.iter().enumerate() {
        for (row, values) in triple.iter().enumerate() {
            for (column, value) in values.iter().enumerate() {
                matrix[(3 * at + column, 3 * at + row)] = *value;
            }
        }
    }
    matrix
}

fn solve_shared(mut shared: Mat<f64>, mut slope: Mat<f64>, held: &[bool]) -> Option<Mat<f64>> {
    for (at, _) in held.iter().enumerate().filter(|(_, held)| **held) {
        for other in 0..held.len() {
            shared[(at, other)] = 0.0;
            shared[(other, at)] = 0.0;
        }
        shared[(at, at)] = 1.0;
        slope[(at, 0)] = 0.0;
    }
    shared.llt(Side::Lower).ok()?.solve_in_place(slope.as_mut());
    Some(slope)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::joints::UNKNOWNS;

    /// Equations of five frames and two shared unknowns, and the same as one dense matrix.
    fn equations() -> (Normal, Mat<f64>) {
        let (frames, shared) = (5, 2);
        let size = frames * UNKNOWNS + shared;
        let mut dense = Mat::zeros(size, size);
        let wave = |at: usize| (at as f64 * 12.9898).sin();
        for row in 0..size {
            dense[(row, row)] = 12.0 + wave(row);
        }
        let mut blocks = Vec::new();
        for frame in 0..frames {
            let mut block = FrameBlock {
                own: Mat::zeros(UNKNOWNS, UNKNOWNS),
                border: Mat::from_fn(UNKNOWNS, 1 + shared, |i, j| 0.3 * wave(7 * i + j + frame)),
                ahead: [[[[0.0; 3]; 3]; UNKNOWNS / 3]; 2],
            };
            for row in 0..UNKNOWNS {
                block.own[(row, row)] = dense[(frame * UNKNOWNS + row, frame * UNKNOWNS + row)];
                for at in 0..shared {
                    let value = block.border[(row, 1 + at)];
                    dense[(frames * UNKNOWNS + at, frame * UNKNOWNS + row)] = value;
                }
            }
            for (ahead, triples) in block.ahead.iter_mut().enumerate() {
                let later = frame + 1 + ahead;
                for (at, triple) in triples.iter_mut().enumerate().filter(|_| later < frames) {
                    for (i, row) in triple.iter_mut().enumerate() {
                        for (j, value) in row.iter_mut().enumerate() {
                            *value = wave(9 * at + 3 * i + j + frame);
                            let later_row = later * UNKNOWNS + 3 * at + i;
                            dense[(later_row, frame * UNKNOWNS + 3 * at + j)] = *value;
                        }
                    }
                }
            }
            blocks.push(block);
        }
        let normal = Normal {
            blocks,
            shared: Mat::from_fn(shared, shared, |i, j| {
                dense[(frames * UNKNOWNS + i, frames * UNKNOWNS + j)]
            }),
            slope: vec![0.7, -0.4],
            held: vec![false; shared],
        };
        (normal, dense)
    }

    #[test]
    fn the_banded_solution_is_the_dense_one() {
        let (mut normal, dense) = equations();
        for is_held in [false, true] {
            normal.held[1] = is_held;
            let step = solve(&normal, 0.0).expect("positive definite");
            let mut all: Vec<f64> = step.frames.concat();
            all.extend(&step.shared);
            let size = all.len();
            assert!(!is_held || all[size - 1] == 0.0);
            for row in 0..size - usize::from(is_held) {
                let at = |column: usize| dense[(row.max(column), row.min(column))] * all[column];
                let sum: f64 = (0..size).map(at).sum();
                let slope = match normal.blocks.get(row / UNKNOWNS) {
                    Some(block) => block.border[(row % UNKNOWNS, 0)],
                    None => normal.slope[row - 5 * UNKNOWNS],
                };
                assert!((sum + slope).abs() < 1e-6, "row {row}: {sum} {slope}");
            }
        }
    }

    #[test]
    fn equations_without_a_minimum_have_no_step() {
        let (mut normal, _) = equations();
        normal.blocks[2].own[(5, 5)] = -1.0;
        assert!(solve(&normal, 1e-3).is_none());
    }
}
