//! Jobs between the API and the store: accepted orders, leases, reports and watches.

mod aliases;
mod checks;
pub mod consent;
pub mod lease;
pub mod queue;
pub mod reaper;
pub mod report;
pub mod retry;
pub mod watch;
pub mod watch_all;
