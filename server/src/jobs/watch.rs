//! Watches of jobs: the current state and every change, resumable by sequence number.

use crate::context::Context;
use crate::notify::changes::{WatchedState, subscribe};
use futures::{Stream, stream};
use std::sync::Arc;
use tokio::sync::watch;
use tokio_util::sync::CancellationToken;
use yoto_proto::v1::Job;
use yoto_request::RequestError;
use yoto_store::Tenant;

struct Watcher {
    context: Arc<Context>,
    tenant: Tenant,
    id: String,
    /// Last sequence number known to the caller.
    known: u64,
    /// Whether the current state was read.
    began: bool,
    states: watch::Receiver<WatchedState>,
    stop: CancellationToken,
    ended: bool,
}

/// The job's states without its order, newer than `after_sequence`, up to a terminal one. Changes faster than the
/// reads may be left out.
///
/// For a caller that has the terminal state already (the same sequence number), the stream ends
/// at once. After a number that the job never had, the stream starts with the current state.
///
/// # Errors
/// The stream fails when the job does not exist, the store fails, or `stop` is cancelled.
pub(crate) fn watch(
    context: Arc<Context>,
    tenant: Tenant,
    id: String,
    after_sequence: u64,
    stop: CancellationToken,
) -> impl Stream<Item = Result<Job, RequestError>> + Send + 'static {
    let watcher = Watcher {
        states: subscribe(&context.notifier, &tenant, &id),
        context,
        tenant,
        id,
        known: after_sequence,
        began: false,
        stop,
        ended: false,
    };
    stream::unfold(watcher, |mut watcher| async move {
        if watcher.ended {
            return None;
        }
        let next = watcher.next().await.transpose();
        watcher.ended = !matches!(&next, Some(Ok(job)) if !job.state().is_terminal());
        next.map(|item| (item, watcher))
    })
}

impl Watcher {
    async fn next(&mut self) -> Result<Option<Job>, RequestError> {
        if !self.began {
            // Reads the job itself instead of the last state sent to other watchers: the caller may know a
            // newer one.
            self.began = true;
            let job = self.context.store.job_state(&self.tenant, &self.id).await?;
            let known = self.known == job.sequence;
            self.known = job.sequence;
            if !known {
                return Ok(Some(job));
            }
            if job.state().is_terminal() {
                return Ok(None);
            }
        }
        loop {
            let seen = self.states.borrow_and_update().clone();
            match seen {
                WatchedState::Job(job) if job.sequence > self.known => {
                    self.known = job.sequence;
                    return Ok(Some(Job::clone(&job)));
                }
                // Reads again to get the reason, or the state if reading works again.
                WatchedState::Unreadable => {
                    drop(self.context.store.job_state(&self.tenant, &self.id).await?)
                }
                WatchedState::Job(_) | WatchedState::Nothing => {}
            }
            tokio::select! {
                changed = self.states.changed() => if changed.is_err() {
                    return Err(RequestError::ShuttingDown);
                },
                () = self.stop.cancelled() => return Err(RequestError::ShuttingDown),
            }
        }
    }
}
