//! Takes jobs back from silent workers, and ends those of people whose consent has run out.

use super::consent;
use crate::context::Context;
use std::sync::Arc;
use tokio::time::{MissedTickBehavior, interval};
use yoto_process::metrics::METRICS;
use yoto_store::{Reaped, StoreError};

/// Reaps until the coordinator stops. A failure is logged and retried at the next tick:
/// nothing else takes the jobs back.
pub(crate) async fn run(context: Arc<Context>) {
    let mut ticks = interval(context.config.reap_interval);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        tokio::select! {
            () = context.stop.cancelled() => return,
            _ = ticks.tick() => {}
        }
        if let Err(error) = tick(&context).await {
            tracing::error!(%error, "could not take back jobs of lost workers");
        }
        if let Err(error) = consent::stop(&context, None).await {
            tracing::error!(%error, "could not end jobs without consent");
        }
    }
}

/// Checks all leases once.
///
/// # Errors
/// When the store fails.
pub(crate) async fn tick(context: &Context) -> Result<(), StoreError> {
    let _one_at_a_time = context.alone.reaping.lock().await;
    let (cap, lease_seconds) = (
        context.config.max_lost_workers,
        context.config.lease_seconds,
    );
    told(context, context.store.tick(cap, lease_seconds).await?);
    Ok(())
}

/// Takes back the jobs of embedded workers, which ended with an earlier process of this coordinator.
///
/// # Errors
/// When the store fails.
pub(crate) async fn take_back_embedded(context: &Context) -> Result<(), StoreError> {
    let cap = context.config.max_lost_workers;
    let taken = context
        .store
        .take_back_embedded(&context.data_dir.instance, cap);
    told(context, taken.await?);
    Ok(())
}

fn told(context: &Context, reaped: Vec<Reaped>) {
    for it in reaped {
        context.notifier.announce_end(&it.job);
        METRICS.lease_lost(&it.job);
        let (job, worker, losses) = (it.job, it.worker, it.losses);
        tracing::warn!(
            job,
            worker,
            losses,
            state = it.state.as_str_name(),
            "worker lost"
        );
    }
}
