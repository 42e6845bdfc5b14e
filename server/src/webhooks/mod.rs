//! Tells addresses of tenants when jobs end.
//!
//! ```text
//! end of a job ─► rows of deliveries, in its transaction ─► run: takes what is due ─► address: where it leads ─► deliver: signs, sends
//! ```
//!
//! The form is that of Standard Webhooks (<https://www.standardwebhooks.com>): `webhook-id`, which repeated attempts share,
//! `webhook-timestamp`, and `webhook-signature`, an HMAC-SHA256 of both and the body. A delivery is at least once.

mod address;
mod deliver;
mod signature;

pub(crate) use address::check_url;
pub(crate) use signature::new_secret;

use crate::capacity::{Owner, Places, Pool};
use crate::context::Context;
use deliver::Sender;
use std::sync::Arc;
use std::time::Duration;
use tokio::task::JoinSet;
use tokio::time::{MissedTickBehavior, interval};
use yoto_store::{DueDelivery, StoreError};

/// Interval of the search for what is due.
const TICK: Duration = Duration::from_secs(1);
/// Deliveries at the same time. A tenant and a webhook have a share of them, so that receivers that don't answer hold up nobody else.
pub(crate) const AT_ONCE: usize = 64;
/// Most deliveries of one webhook that begin at one tick.
const PER_TICK: usize = 16;
/// Time for which nobody else tries a delivery that was taken, seconds: more than an attempt takes.
const TAKEN: f64 = 60.0;
/// Time until the second attempt, seconds. Each later one takes twice as long, up to [`LONGEST`].
const FIRST: f64 = 5.0;
/// Longest time between two attempts, seconds.
const LONGEST: f64 = 3600.0;
/// Attempts, over about a day.
const ATTEMPTS: u32 = 32;

/// Delivers until the coordinator stops.
pub(crate) async fn run(context: Arc<Context>) {
    let sender = match Sender::new(context.config.private_webhooks) {
        Ok(sender) => sender,
        Err(error) => {
            tracing::error!(%error, "no webhook is told anything");
            return;
        }
    };
    let sender = Arc::new(sender);
    let places = Pool::new("deliveries of webhooks", AT_ONCE);
    let mut attempts = JoinSet::new();
    let mut ticks = interval(TICK);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        tokio::select! {
            // What was on its way is tried again later, by whoever comes next.
            () = context.stop.cancelled() => return,
            _ = ticks.tick() => {}
        }
        while attempts.try_join_next().is_some() {}
        match begin(&context, &places).await {
            Err(error) => tracing::error!(%error, "could not look for webhooks to tell"),
            Ok(due) => {
                for (delivery, place) in due {
                    let (context, sender) = (Arc::clone(&context), Arc::clone(&sender));
                    attempts.spawn(async move {
                        attempt(&context, &sender, delivery).await;
                        drop(place);
                    });
                }
            }
        }
    }
}

/// Takes what is due, as far as the shares of its tenants and webhooks allow.
async fn begin(
    context: &Context,
    places: &Arc<Pool>,
) -> Result<Vec<(DueDelivery, Places)>, StoreError> {
    let due = context.store.due_webhooks().await?;
    let mut granted: Vec<Vec<Places>> = due.iter().map(|_| Vec::new()).collect();
    // One place for each in turn.
    for _ in 0..PER_TICK {
        for (webhook, granted) in due.iter().zip(&mut granted) {
            let tenant = Owner::Tenant(webhook.tenant.id().into());
            let own = Owner::Webhook(webhook.id.as_str().into());
            granted.extend(places.take(&[tenant, own], 1).ok());
        }
    }
    let mut begun = Vec::new();
    for (webhook, granted) in due.iter().zip(granted) {
        let most = u32::try_from(granted.len()).unwrap_or(u32::MAX);
        if most == 0 {
            continue;
        }
        let taken = context.store.take_deliveries(webhook, most, TAKEN);
        match taken.await {
            Ok(taken) => begun.extend(taken.into_iter().zip(granted)),
            // What was taken before is told.
            Err(error) => {
                tracing::error!(%error, webhook = webhook.id, "could not look for what to tell");
            }
        }
    }
    Ok(begun)
}

async fn attempt(context: &Context, sender: &Sender, delivery: DueDelivery) {
    let (webhook, job, attempts) = (&delivery.webhook_id, &delivery.job.name, delivery.attempts);
    let (error, again) = match sender.send(&delivery).await {
        Ok(()) => (String::new(), None),
        Err(error) => (error.to_string(), pause(attempts)),
    };
    if error.is_empty() {
        tracing::debug!(
            webhook,
            job,
            attempts,
            "a webhook was told of the end of a job"
        );
    } else {
        let last = again.is_none();
        tracing::warn!(
            webhook,
            job,
            attempts,
            last,
            error,
            "a webhook could not be told of the end of a job"
        );
    }
    if let Err(error) = context.store.delivery_tried(&delivery, &error, again).await {
        tracing::error!(%error, webhook, job, "could not note that a webhook was told");
    }
}

/// Time until the attempt after `attempts`, seconds; `None` after the last one.
fn pause(attempts: u32) -> Option<f64> {
    let longer = 2f64.powi(attempts.saturating_sub(1).min(16) as i32);
    (attempts < ATTEMPTS).then(|| (FIRST * longer).min(LONGEST))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attempts_go_on_for_a_day() {
        assert_eq!(pause(1), Some(5.0));
        assert_eq!(pause(2), Some(10.0));
        assert_eq!(pause(ATTEMPTS - 1), Some(LONGEST));
        assert_eq!(pause(ATTEMPTS), None);
        let all: f64 = (1..ATTEMPTS).filter_map(pause).sum();
        assert!((20.0..30.0).contains(&(all / 3600.0)), "{all} s");
    }
}
