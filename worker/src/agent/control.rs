//! State shared by the lease's keeper and the job: whether the job may continue.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;
use tokio::sync::watch;

/// Reasons for a job to stop, from the mildest to the most urgent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum StopReason {
    /// The worker is shutting down: save, then return the job.
    ShuttingDown,
    /// The user cancelled the job: save, then report it.
    Cancelled,
    /// The lease has expired, or the coordinator has refused it. Another worker may have the job: write nothing more.
    LeaseLost,
}

#[derive(Debug, Clone, Copy)]
struct State {
    stop: Option<StopReason>,
    deadline: Instant,
}

/// Whether a leased job may continue.
///
/// The deadline is kept here, and not only in the heartbeat's task, so that a process that was
/// paused past its lease stops before its next write, on any thread.
#[derive(Debug)]
pub struct JobControl {
    state: watch::Sender<State>,
    /// Grows with each sign of life of the job.
    signs: AtomicU64,
}

impl JobControl {
    /// A job with a lease until `deadline`, on this machine's monotonic clock.
    pub fn new(deadline: Instant) -> Self {
        let state = State {
            stop: None,
            deadline,
        };
        Self {
            state: watch::Sender::new(state),
            signs: AtomicU64::new(0),
        }
    }

    /// The job shows that it still works.
    pub fn sign(&self) {
        self.signs.fetch_add(1, Ordering::Relaxed);
    }

    /// Number of signs of life so far.
    pub fn signs(&self) -> u64 {
        self.signs.load(Ordering::Relaxed)
    }

    /// Tells the job to stop. A more urgent reason replaces a milder one, never the reverse.
    pub fn stop(&self, reason: StopReason) {
        self.state.send_if_modified(|state| {
            let news = state.stop < Some(reason);
            if news {
                state.stop = Some(reason);
            }
            news
        });
    }

    /// The lease now lasts until `deadline`. A lost lease stays lost.
    pub fn renew(&self, deadline: Instant) {
        if self.stopped() != Some(StopReason::LeaseLost) {
            self.state
                .send_modify(|state| state.deadline = deadline.max(state.deadline));
        }
    }

    /// Deadline of the lease.
    pub fn deadline(&self) -> Instant {
        self.state.borrow().deadline
    }

    /// The reason to stop, if there is one.
    pub fn stopped(&self) -> Option<StopReason> {
        let state = *self.state.borrow();
        if Instant::now() >= state.deadline {
            return Some(StopReason::LeaseLost);
        }
        state.stop
    }

    /// Whether the lease was refused. Without a refusal, a lease that has expired here may still be valid for a
    /// coordinator that did not answer.
    pub fn is_refused(&self) -> bool {
        self.state.borrow().stop == Some(StopReason::LeaseLost)
    }

    /// Returns once the lease is refused.
    pub async fn refused(&self) {
        let mut changes = self.state.subscribe();
        // The sender is `self`, which outlives this wait.
        let _ = changes
            .wait_for(|state| state.stop == Some(StopReason::LeaseLost))
            .await;
    }

    /// Returns once the lease is lost.
    pub async fn lease_lost(&self) {
        let mut changes = self.state.subscribe();
        loop {
            let deadline = changes.borrow_and_update().deadline;
            if self.stopped() == Some(StopReason::LeaseLost) {
                return;
            }
            tokio::select! {
                () = tokio::time::sleep_until(deadline.into()) => {}
                // The sender is `self`, which outlives this wait.
                _ = changes.changed() => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn leased_for(time: Duration) -> JobControl {
        JobControl::new(Instant::now() + time)
    }

    #[test]
    fn a_more_urgent_reason_wins_in_either_order() {
        let control = leased_for(Duration::from_secs(60));
        assert_eq!(control.stopped(), None);
        control.stop(StopReason::Cancelled);
        control.stop(StopReason::ShuttingDown);
        assert_eq!(control.stopped(), Some(StopReason::Cancelled));
        control.stop(StopReason::LeaseLost);
        assert_eq!(control.stopped(), Some(StopReason::LeaseLost));
    }

    #[test]
    fn a_lease_that_ran_out_is_lost_without_anyone_telling_and_for_good() {
        let control = leased_for(Duration::ZERO);
        assert_eq!(control.stopped(), Some(StopReason::LeaseLost));
        control.renew(Instant::now() + Duration::from_secs(60));
        assert_eq!(control.stopped(), Some(StopReason::LeaseLost));
    }

    #[tokio::test]
    async fn an_expired_lease_is_not_refused() {
        let control = leased_for(Duration::ZERO);
        assert_eq!(control.stopped(), Some(StopReason::LeaseLost));
        assert!(!control.is_refused(), "nobody has said so");
        control.stop(StopReason::LeaseLost);
        assert!(control.is_refused());
        control.refused().await;
    }

    #[tokio::test]
    async fn waiting_for_the_loss_follows_renewals() {
        let control = leased_for(Duration::from_secs(2));
        let renewed = Instant::now() + Duration::from_secs(3);
        control.renew(renewed);
        control.lease_lost().await;
        assert!(Instant::now() >= renewed);
    }
}
