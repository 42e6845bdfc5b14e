//! The worker: leases jobs from the coordinator, runs them, and hands back what came out.
//!
//! [`agent`] talks to the coordinator and keeps the lease; [`jobs`] do the work on a thread
//! of their own and never touch the network except through their
//! [`JobContext`](jobs::JobContext); [`media`] encodes pictures (uploads are read by
//! `yoto_ingest`); [`objects`] reads and writes the object store.

pub mod agent;
pub mod jobs;
pub mod media;
pub mod objects;
mod retry;

pub use agent::{Worker, WorkerConfig, WorkerError};
