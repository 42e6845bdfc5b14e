//! Jobs between the API and the store: accepted orders, leases, reports and watches.

pub mod changes;
mod checks;
pub mod lease;
pub mod queue;
pub mod reaper;
pub mod report;
pub mod roster;
pub mod watch;
