//! Takes jobs back from silent workers.

use crate::context::Context;
use std::sync::Arc;
use tokio::time::{MissedTickBehavior, interval};

/// Reaps until the coordinator stops. A failure is logged and retried at the next turn:
/// nothing else takes the jobs back.
pub async fn run(context: Arc<Context>) {
    let mut turns = interval(context.config.reap_interval);
    turns.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        tokio::select! {
            () = context.stop.cancelled() => return,
            _ = turns.tick() => {}
        }
        match context.store.reap(context.config.max_lost_workers).await {
            Ok(reaped) if reaped.is_empty() => {}
            Ok(reaped) => {
                context.changes.announce();
                for job in reaped {
                    let state = job.state.as_str_name();
                    let (worker, lost_workers) = (job.worker, job.lost_workers);
                    tracing::warn!(job = job.job, worker, lost_workers, state, "lease expired");
                }
            }
            Err(error) => tracing::error!(%error, "could not take back jobs of lost workers"),
        }
    }
}
