//! A coordinator as a process: its clock, its metrics, its private files, and the faults that tests inject.
//!
//! Everything of the coordinator may use these; they use nothing of it.

pub mod clock;
pub mod faults;
pub mod metrics;
pub mod private;
