//! Levenberg–Marquardt: steps of the normal equations, damped more after a step that fails.

use crate::banded::{self, Step};
use crate::joints::UNKNOWNS;
use crate::normal::{self, Normal, squared};
use crate::parameters::{Shared, Stance};
use crate::problem::{Observed, Problem};
use crate::residuals::{self, Columns};
use faer::prelude::Solve;
use faer::{Mat, Side};

/// The search ends after a step that lowers the cost by a smaller share.
const ENOUGH: f64 = 3e-4;
/// The search ends at this damping, with which steps are too small to matter.
const MOST_DAMPING: f64 = 1e6;

/// A guess of all unknowns.
#[derive(Clone, Debug)]
pub(crate) struct Guess {
    pub stances: Vec<Stance>,
    pub shared: Shared,
    /// Its cost.
    pub cost: f64,
}

impl Guess {
    /// The guess of `stances` and `shared`.
    pub(crate) fn new(problem: &Problem, stances: Vec<Stance>, shared: Shared) -> Self {
        Self {
            cost: normal::cost(problem, &stances, &shared),
            stances,
            shared,
        }
    }

    fn moved(&self, problem: &Problem, step: &Step) -> Self {
        let moved = self.stances.iter().zip(&step.frames);
        let stances = moved.map(|(stance, by)| stance.moved(by)).collect();
        Self::new(problem, stances, self.shared.moved(&step.shared))
    }
}

/// Lowers the cost of `guess` by at most `steps` steps; `progress` is called before each.
pub(crate) fn improve(
    problem: &Problem,
    mut guess: Guess,
    steps: usize,
    progress: &mut dyn FnMut(usize),
) -> Guess {
    let mut damping = 1e-3;
    for at in 0..steps {
        progress(at);
        let normal = Normal::new(problem, &guess.stances, &guess.shared);
        let better = loop {
            let step = banded::solve(&normal, damping);
            let tried = step.map(|step| guess.moved(problem, &step));
            if let Some(tried) = tried.filter(|tried| tried.cost < guess.cost) {
                break Some(tried);
            }
            damping *= 8.0;
            if damping > MOST_DAMPING {
                break None;
            }
        };
        let Some(better) = better else {
            return guess;
        };
        damping = (damping / 5.0).max(1e-7);
        let done = guess.cost - better.cost < ENOUGH * better.cost;
        guess = better;
        if done {
            return guess;
        }
    }
    guess
}

/// Lowers the cost of one frame by itself, with fixed `shared`. Returns the stance and its cost.
pub(crate) fn improve_frame(
    problem: &Problem,
    observed: &Observed,
    stance: &Stance,
    shared: &Shared,
    steps: usize,
) -> (Stance, f64) {
    let of =
        |stance: &Stance, columns| residuals::frame(problem, observed, stance, shared, columns);
    let (mut best, mut damping) = (stance.clone(), 1e-2);
    let mut cost = of(&best, Columns::Cost).cost;
    for _ in 0..steps {
        let rows = of(&best, Columns::Frame);
        let all = squared(&rows);
        let slope: Vec<f64> = (0..UNKNOWNS)
            .map(|column| {
                let slopes = rows.slopes.chunks_exact(UNKNOWNS).zip(&rows.values);
                -slopes.map(|(row, value)| row[column] * value).sum::<f64>()
            })
            .collect();
        let before = cost;
        while damping < MOST_DAMPING {
            if let Some(step) = solve_dense(&all, &slope, damping) {
                let tried = best.moved(&step);
                let tried_cost = of(&tried, Columns::Cost).cost;
                if tried_cost < cost {
                    (best, cost) = (tried, tried_cost);
                    break;
                }
            }
            damping *= 8.0;
        }
        damping /= 5.0;
        if before - cost < 1e-2 * cost {
            break;
        }
    }
    (best, cost)
}

fn solve_dense(all: &Mat<f64>, slope: &[f64], damping: f64) -> Option<Vec<f64>> {
    let mut damped = all.clone();
    for row in 0..slope.len() {
        damped[(row, row)] += damping * damped[(row, row)] + 1e-9;
    }
    let mut step = Mat::from_fn(slope.len(), 1, |row, _| slope[row]);
    damped.llt(Side::Lower).ok()?.solve_in_place(step.as_mut());
    let step: Vec<f64> = step.col(0).iter().copied().collect();
    step.iter().all(|value| value.is_finite()).then_some(step)
}
