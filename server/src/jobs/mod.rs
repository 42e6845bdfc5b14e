//! Jobs between the API and the store: accepted orders, leases, reports and watches.

mod aliases;
mod checks;
pub(crate) mod consent;
pub(crate) mod lease;
pub(crate) mod queue;
pub(crate) mod reaper;
pub(crate) mod report;
pub(crate) mod retry;
pub(crate) mod watch;
pub(crate) mod watch_all;
