//! The normal equations of a fit: a block for each frame, coupled to the next two frames, and a border for
//! the shared unknowns.

use crate::joints::UNKNOWNS;
use crate::parameters::{Shared, Stance};
use crate::problem::Problem;
use crate::residuals::shared::{held, rows as shared_rows};
use crate::residuals::{self, Columns, Rows, smooth};
use crate::rotation::{matmul, matvec, transpose};
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::{Accum, Mat, MatRef, Par};
use rayon::prelude::*;
use yoto_capture::skeleton::transform::Mat3;

/// Number of triples of unknowns in a frame: accelerations couple triples.
const TRIPLES: usize = UNKNOWNS / 3;

/// One frame's part of the equations.
#[derive(Clone, Debug)]
pub(crate) struct FrameBlock {
    /// `[UNKNOWNS, UNKNOWNS]`; only the lower triangle is used.
    pub own: Mat<f64>,
    /// `[UNKNOWNS, 1 + shared]`: half the gradient of the cost, then the coupling to shared unknowns.
    pub border: Mat<f64>,
    /// Coupling of this frame's triples (columns) to those of the next frame (rows), and of the
    /// frame after.
    pub ahead: [[Mat3; TRIPLES]; 2],
}

/// The equations for a Gauss-Newton step.
#[derive(Clone, Debug)]
pub(crate) struct Normal {
    pub blocks: Vec<FrameBlock>,
    /// `[shared, shared]`; only the lower triangle is used.
    pub shared: Mat<f64>,
    /// Half the gradient of the cost by the shared unknowns.
    pub slope: Vec<f64>,
    /// For each shared unknown, whether it is fixed.
    pub held: Vec<bool>,
}

/// The cost of a guess.
pub(crate) fn cost(problem: &Problem, stances: &[Stance], shared: &Shared) -> f64 {
    let frames: f64 = problem
        .frames
        .par_iter()
        .zip(stances)
        .map(|(seen, stance)| residuals::frame(problem, seen, stance, shared, Columns::Cost).cost)
        .sum();
    let accelerations: f64 = threes(problem, stances)
        .map(|(_, stances, times)| smooth::cost(stances, times))
        .sum();
    let rows = shared_rows(problem, shared);
    frames + accelerations + rows.iter().map(|(_, value, _)| value * value).sum::<f64>()
}

/// All runs of three frames: the index of the first, stances and times.
fn threes<'a>(
    problem: &'a Problem,
    stances: &'a [Stance],
) -> impl Iterator<Item = (usize, [&'a Stance; 3], [f64; 3])> {
    let times = problem.frames.windows(3);
    let pairs = stances.windows(3).zip(times).enumerate();
    pairs.filter_map(|(at, (stances, seen))| match (stances, seen) {
        ([a, b, c], [x, y, z]) => Some((at, [a, b, c], [x.time, y.time, z.time])),
        _ => None,
    })
}

impl Normal {
    /// The equations at a guess.
    pub(crate) fn new(problem: &Problem, stances: &[Stance], shared: &Shared) -> Self {
        let unknowns = shared.values.len();
        let parts: Vec<(FrameBlock, Mat<f64>, Vec<f64>)> = problem
            .frames
            .par_iter()
            .zip(stances)
            .map(|(seen, stance)| {
                let columns = Columns::All(unknowns);
                block(&residuals::frame(problem, seen, stance, shared, columns))
            })
            .collect();
        let mut normal = Self {
            blocks: Vec::with_capacity(parts.len()),
            shared: Mat::zeros(unknowns, unknowns),
            slope: vec![0.0; unknowns],
            held: held(problem, unknowns),
        };
        for (block, of_shared, slope) in parts {
            normal.blocks.push(block);
            normal.shared += of_shared;
            for (sum, value) in normal.slope.iter_mut().zip(slope) {
                *sum += value;
            }
        }
        for (at, value, slope) in shared_rows(problem, shared) {
            normal.shared[(at, at)] += slope * slope;
            normal.slope[at] += slope * value;
        }
        for (at, stances, times) in threes(problem, stances) {
            for acceleration in smooth::accelerations(stances, times) {
                normal.add_acceleration(at, &acceleration);
            }
        }
        normal
    }

    /// Adds an acceleration over the frames from `first`.
    fn add_acceleration(&mut self, first: usize, acceleration: &smooth::Acceleration) {
        let column = acceleration.column;
        for (i, slope) in acceleration.slopes.iter().enumerate() {
            let back = transpose(slope);
            let Some(block) = self.blocks.get_mut(first + i) else {
                return;
            };
            let pull = matvec(&back, acceleration.value);
            let own = matmul(&back, slope);
            for row in 0..3 {
                block.border[(column + row, 0)] += pull[row];
                for (other, by) in own[row].iter().enumerate() {
                    block.own[(column + row, column + other)] += by;
                }
            }
            for (ahead, later) in acceleration.slopes.iter().skip(i + 1).enumerate() {
                let coupling = matmul(&transpose(later), slope);
                let sum = &mut block.ahead[ahead][column / 3];
                for (to, from) in sum.iter_mut().flatten().zip(coupling.iter().flatten()) {
                    *to += from;
                }
            }
        }
    }
}

/// A frame's block, and its contribution to the equations of the shared unknowns.
fn block(rows: &Rows) -> (FrameBlock, Mat<f64>, Vec<f64>) {
    let (width, count) = (rows.width, rows.values.len());
    let all = squared(rows);
    let slopes = MatRef::from_row_major_slice(&rows.slopes, count, width);
    let slope = |column: usize| -> f64 {
        let values = rows.values.iter().enumerate();
        values
            .map(|(row, value)| slopes[(row, column)] * value)
            .sum()
    };
    let shared = width - UNKNOWNS;
    let border = Mat::from_fn(UNKNOWNS, 1 + shared, |row, column| match column {
        0 => slope(row),
        _ => all[(UNKNOWNS + column - 1, row)],
    });
    let block = FrameBlock {
        own: all.submatrix(0, 0, UNKNOWNS, UNKNOWNS).to_owned(),
        border,
        ahead: [[[[0.0; 3]; 3]; TRIPLES]; 2],
    };
    let of_shared = all.submatrix(UNKNOWNS, UNKNOWNS, shared, shared).to_owned();
    (block, of_shared, (UNKNOWNS..width).map(slope).collect())
}

/// The lower triangle of JᵀJ, where J is the table.
pub(crate) fn squared(rows: &Rows) -> Mat<f64> {
    let (width, count) = (rows.width, rows.values.len());
    let slopes = MatRef::from_row_major_slice(&rows.slopes, count, width);
    let mut all = Mat::zeros(width, width);
    triangular::matmul(
        all.as_mut(),
        BlockStructure::TriangularLower,
        Accum::Replace,
        slopes.transpose(),
        BlockStructure::Rectangular,
        slopes,
        BlockStructure::Rectangular,
        1.0,
        Par::Seq,
    );
    all
}
