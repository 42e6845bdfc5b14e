//! The trade-off between time and fidelity: its measurement and its use.
//!
//! [`sweep`](mod@sweep) renders given views with a list of settings ([`axes`]) and measures a
//! [`Curve`]; [`pareto`] finds the points that no other one dominates; [`choose`](mod@choose)
//! selects settings of the curve for a request such as "at most 0.1 s per frame".

pub mod axes;
pub mod choose;
pub mod curve;
pub mod pareto;
pub mod sweep;

pub use axes::Axes;
pub use choose::{Choice, ChooseError, Want, choose};
pub use curve::{Curve, CurveError, Machine, Point, SizeCheck};
pub use sweep::{SweepError, SweepOptions, SweepView, sweep};
