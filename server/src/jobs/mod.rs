//! The queue's rules: what may be queued, who gets it, how it ends, who watches.

pub mod changes;
mod inputs;
pub mod lease;
pub mod queue;
pub mod reaper;
pub mod report;
mod spec;
pub mod watch;
