//! Residuals: what is unlikely about a guess, in standard deviations, with derivatives.
//!
//! One file per kind. Those of one frame fill a table of [`Rows`]; [`smooth`] couples three
//! frames, [`shared`] concerns what all frames share.

pub(crate) mod habit;
pub(crate) mod picture;
pub(crate) mod shared;
pub(crate) mod smooth;
pub(crate) mod space;
#[cfg(test)]
mod tests;
pub(crate) mod upright;

use crate::forward::Posed;
use crate::joints::UNKNOWNS;
use crate::parameters::{Shared, Stance};
use crate::problem::{Observed, Problem};

/// Which derivatives a table has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Columns {
    /// None: only the cost is wanted.
    Cost,
    /// By the frame's unknowns.
    Frame,
    /// By the frame's, then by `n` shared unknowns.
    All(usize),
}

/// A table of residuals.
#[derive(Debug)]
pub(crate) struct Rows {
    columns: Columns,
    /// Columns of the table.
    pub width: usize,
    /// `[rows, width]`.
    pub slopes: Vec<f64>,
    /// `[rows]`.
    pub values: Vec<f64>,
    /// The sum of what the residuals cost.
    pub cost: f64,
}

impl Rows {
    pub fn new(columns: Columns) -> Self {
        Self {
            columns,
            width: match columns {
                Columns::Cost => 0,
                Columns::Frame => UNKNOWNS,
                Columns::All(shared) => UNKNOWNS + shared,
            },
            slopes: Vec::new(),
            values: Vec::new(),
            cost: 0.0,
        }
    }

    /// Whether anything but the cost is wanted.
    pub fn has_slopes(&self) -> bool {
        self.columns != Columns::Cost
    }

    /// Whether the table has columns of shared unknowns.
    pub fn has_shared(&self) -> bool {
        matches!(self.columns, Columns::All(_))
    }

    /// Adds a residual that is already scaled by its weight.
    pub fn push(&mut self, value: f64, slopes: impl FnOnce(&mut [f64])) {
        if !self.has_slopes() {
            return;
        }
        self.values.push(value);
        let from = self.slopes.len();
        self.slopes.resize(from + self.width, 0.0);
        if let Some(row) = self.slopes.get_mut(from..) {
            slopes(row);
        }
    }

    /// Adds a squared residual's cost and returns the factor of its rows. Geman and McClure's
    /// function: residuals far beyond `bound` standard deviations cost `bound²` at most and pull
    /// no more.
    pub fn robust(&mut self, squared: f64, bound: f64) -> f64 {
        let shrink = 1.0 / (1.0 + squared / (bound * bound));
        self.cost += squared * shrink;
        shrink
    }

    /// Adds a residual without a bound.
    pub fn plain(&mut self, value: f64, slopes: impl FnOnce(&mut [f64])) {
        self.cost += value * value;
        self.push(value, slopes);
    }
}

/// The residuals of one frame.
pub(crate) fn frame(
    problem: &Problem,
    observed: &Observed,
    stance: &Stance,
    shared: &Shared,
    columns: Columns,
) -> Rows {
    let mut rows = Rows::new(columns);
    let posed = Posed::new(stance, shared);
    picture::add(&mut rows, problem, observed, &posed, shared);
    space::add(&mut rows, problem, observed, &posed, shared);
    habit::add(&mut rows, stance);
    if problem.upright {
        upright::add(&mut rows, &posed, shared);
    }
    rows
}
