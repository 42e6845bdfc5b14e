//! A coordinator as a process: its clock, its metrics, its private files, the faults that tests inject, and what a task
//! costs the database.
//!
//! Everything of the coordinator may use these; they use nothing of it.

pub mod clock;
pub mod faults;
pub mod metrics;
pub mod private;
pub mod statements;
