//! The rules of the queue: accepted jobs, leases, outcomes and watches.

pub mod changes;
mod inputs;
pub mod lease;
pub mod queue;
pub mod reaper;
pub mod report;
pub mod roster;
mod spec;
pub mod watch;
