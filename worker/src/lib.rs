//! The worker: leases jobs from the coordinator, runs them, and returns their results.
//!
//! [`agent`] talks to the coordinator and keeps the lease; [`jobs`] run on their own thread
//! and use the network only through their
//! [`JobContext`](jobs::JobContext); [`media`] encodes pictures (uploads are read by
//! `yoto_ingest`).

pub mod agent;
pub mod jobs;
pub mod media;
mod retry;

pub use agent::{Worker, WorkerConfig, WorkerError};
