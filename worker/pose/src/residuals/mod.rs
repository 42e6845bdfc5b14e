//! Residuals: the deviations of a guess from the observations and priors, in standard deviations, with
//! derivatives.
//!
//! There is one file per kind. The residuals of one frame fill a table of [`Rows`]. [`smooth`] couples three
//! frames, and [`shared`] has the priors of the unknowns that all frames share.

pub(crate) mod depth;
pub(crate) mod floor;
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

/// The derivatives in a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Columns {
    /// None, only the cost.
    Cost,
    /// Derivatives by the frame's unknowns.
    Frame,
    /// Derivatives by the frame's unknowns, then by this number of shared unknowns.
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
    /// The sum of the residuals' costs.
    pub cost: f64,
}

impl Rows {
    pub(crate) fn new(columns: Columns) -> Self {
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

    /// Whether the table has derivatives.
    pub(crate) fn has_slopes(&self) -> bool {
        self.columns != Columns::Cost
    }

    /// Whether the table has columns of shared unknowns.
    pub(crate) fn has_shared(&self) -> bool {
        matches!(self.columns, Columns::All(_))
    }

    /// Adds a residual that is already scaled by its weight, without its cost.
    pub(crate) fn push(&mut self, value: f64, slopes: impl FnOnce(&mut [f64])) {
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

    /// Adds the cost of a squared residual r² and returns the factor of its rows, by Geman and McClure's
    /// function `r² / (1 + r² / bound²)`. A residual far beyond `bound` standard deviations costs `bound²`
    /// at most and has no more influence.
    pub(crate) fn robust(&mut self, squared: f64, bound: f64) -> f64 {
        let shrink = 1.0 / (1.0 + squared / (bound * bound));
        self.cost += squared * shrink;
        shrink
    }

    /// Adds a residual with its squared cost, without a bound.
    pub(crate) fn plain(&mut self, value: f64, slopes: impl FnOnce(&mut [f64])) {
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
    depth::add(&mut rows, problem, observed, &posed, shared);
    habit::add(&mut rows, stance);
    if problem.upright {
        upright::add(&mut rows, &posed, shared);
        floor::add(&mut rows, problem, observed, &posed, shared);
    }
    rows
}
