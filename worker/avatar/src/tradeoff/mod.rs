//! The trade of seconds for fidelity, measured on a model and put to use.
//!
//! [`sweep`] renders given views with a list of settings ([`axes`]) and writes down a
//! [`Curve`]; [`pareto`] keeps the settings that nothing beats; [`choose`] answers a wish
//! ("at most 0.1 s a frame") with settings of the curve.

pub mod axes;
pub mod choose;
pub mod curve;
pub mod pareto;
pub mod sweep;

pub use axes::Axes;
pub use choose::{Choice, ChooseError, Want, choose};
pub use curve::{Curve, CurveError, Machine, Point, SizeCheck};
pub use sweep::{SweepError, SweepOptions, SweepView, sweep};
