//! The worker: leases jobs from the coordinator, runs them, and returns their results.
//!
//! [`agent`] talks to the coordinator and keeps the lease; [`jobs`] run on their own thread and use the network
//! only through their [`JobContext`](jobs::JobContext). Uploads are read by `yoto_ingest`, renders are planned by
//! `yoto_film`.

pub mod agent;
pub mod jobs;
mod retry;

pub use agent::{Ended, JobEnd, Worker, WorkerConfig, WorkerError};
