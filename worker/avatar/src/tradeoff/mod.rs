//! The trade-off between time and fidelity: its measurement and its use.
//!
//! [`sweep`](fn@sweep) renders given views with a list of settings ([`Axes`]) and measures a
//! [`Curve`]; [`pareto`] finds the points that no other one dominates; [`choose()`] selects
//! settings of the curve for a request such as "at most 0.1 s per frame"; a [`Tradeoff`] is what
//! experiments and the service write to disk.

mod axes;
mod choose;
mod curve;
pub mod pareto;
mod report;
mod rows;
pub mod sweep;

pub use axes::Axes;
pub use choose::{Choice, ChooseError, Want, choose};
pub use curve::{Curve, CurveError, Machine, Point, SizeCheck};
pub use report::{Tradeoff, Trained, WriteError};
pub use sweep::{SweepError, SweepOptions, SweepView, sweep};
