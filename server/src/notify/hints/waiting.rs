//! Workers that wait for a job.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::oneshot;
use yoto_store::{JobKind, Tenant};

/// Most workers that wait at one coordinator. Others ask by the clock.
const WORKERS: usize = 1024;

/// How long a hint without a worker is kept for one that has just asked in vain and comes to wait.
const KEPT: Duration = Duration::from_secs(1);
/// Most hints that are kept.
const KEPT_HINTS: usize = 64;

/// Too many workers wait already.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Busy;

/// The workers that wait, the one that has waited longest first.
#[derive(Debug, Default)]
pub(crate) struct WaitingWorkers(Mutex<Queue>);

#[derive(Debug, Default)]
struct Queue {
    workers: VecDeque<Waiting>,
    /// Hints that found no worker, and when they came.
    kept: VecDeque<(Tenant, JobKind, Instant)>,
    /// Number of the next one.
    next: u64,
}

#[derive(Debug)]
struct Waiting {
    number: u64,
    tenant: Tenant,
    kinds: Vec<JobKind>,
    wake: oneshot::Sender<()>,
}

/// A place among the waiting workers, which ends with this value.
struct Seat<'a> {
    all: &'a WaitingWorkers,
    number: u64,
}

impl WaitingWorkers {
    /// Waits until a job of one of the `kinds` is queued, at most for `time`. Returns whether one was.
    ///
    /// # Errors
    /// When too many wait already.
    pub(crate) async fn wait(
        &self,
        tenant: &Tenant,
        kinds: Vec<JobKind>,
        time: Duration,
    ) -> Result<bool, Busy> {
        if self.lock().take_kept(tenant, &kinds, Instant::now()) {
            return Ok(true);
        }
        let (wake, woken) = oneshot::channel();
        let seat = self.sit(tenant, kinds, wake)?;
        let woken = tokio::time::timeout(time, woken).await;
        drop(seat);
        Ok(matches!(woken, Ok(Ok(()))))
    }

    /// A job of `kind` is queued: the worker that has waited longest for one asks for it. One alone, since only one gets it.
    pub(crate) fn wake(&self, tenant: &Tenant, kind: JobKind) {
        let mut queue = self.lock();
        let fits = |it: &Waiting| it.tenant == *tenant && it.kinds.contains(&kind);
        while let Some(at) = queue.workers.iter().position(fits) {
            // The next one, if this one has gone meanwhile.
            if let Some(worker) = queue.workers.remove(at)
                && worker.wake.send(()).is_ok()
            {
                return;
            }
        }
        queue.keep(tenant, kind, Instant::now());
    }

    fn sit(
        &self,
        tenant: &Tenant,
        kinds: Vec<JobKind>,
        wake: oneshot::Sender<()>,
    ) -> Result<Seat<'_>, Busy> {
        let mut queue = self.lock();
        if queue.workers.len() >= WORKERS {
            return Err(Busy);
        }
        let number = queue.next;
        queue.next += 1;
        queue.workers.push_back(Waiting {
            number,
            tenant: tenant.clone(),
            kinds,
            wake,
        });
        Ok(Seat { all: self, number })
    }

    fn lock(&self) -> MutexGuard<'_, Queue> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Queue {
    /// Keeps a hint that came `now` and found no worker.
    fn keep(&mut self, tenant: &Tenant, kind: JobKind, now: Instant) {
        if self.kept.len() >= KEPT_HINTS {
            self.kept.pop_front();
        }
        self.kept.push_back((tenant.clone(), kind, now));
    }

    /// Whether a hint for such a worker came a moment before `now` and found none. It is for one worker.
    fn take_kept(&mut self, tenant: &Tenant, kinds: &[JobKind], now: Instant) -> bool {
        self.kept
            .retain(|(_, _, came)| now.saturating_duration_since(*came) < KEPT);
        let fits =
            |(of, kind, _): &(Tenant, JobKind, Instant)| of == tenant && kinds.contains(kind);
        let at = self.kept.iter().position(fits);
        at.is_some_and(|at| self.kept.remove(at).is_some())
    }
}

impl Drop for Seat<'_> {
    fn drop(&mut self) {
        let mut queue = self.all.lock();
        queue.workers.retain(|it| it.number != self.number);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures::FutureExt;

    const LONG: Duration = Duration::from_secs(3600);

    #[tokio::test]
    async fn one_worker_that_can_run_the_job_is_woken() {
        let all = WaitingWorkers::default();
        let (own, other) = (Tenant::default(), Tenant::new("other").expect("an id"));
        let wait = |tenant, kind| Box::pin(all.wait(tenant, vec![kind], LONG));
        let mut trains = wait(&own, JobKind::Train);
        let mut others = wait(&other, JobKind::Render);
        let mut first = wait(&own, JobKind::Render);
        let mut second = wait(&own, JobKind::Render);
        for waits in [&mut trains, &mut others, &mut first, &mut second] {
            assert_eq!(waits.now_or_never(), None);
        }
        all.wake(&own, JobKind::Render);
        assert_eq!(first.now_or_never(), Some(Ok(true)));
        for waits in [&mut trains, &mut others, &mut second] {
            assert_eq!(waits.now_or_never(), None);
        }
        // One that has gone is not woken in place of another.
        drop(trains);
        all.wake(&own, JobKind::Train);
        all.wake(&own, JobKind::Render);
        assert_eq!(second.now_or_never(), Some(Ok(true)));
    }

    #[test]
    fn a_hint_that_comes_between_a_question_and_a_wait_is_not_lost() {
        let mut queue = Queue::default();
        let (own, other) = (Tenant::default(), Tenant::new("other").expect("an id"));
        let (now, kind) = (Instant::now(), JobKind::Render);
        queue.keep(&own, kind, now);
        assert!(!queue.take_kept(&own, &[JobKind::Train], now));
        assert!(!queue.take_kept(&other, &[kind], now));
        assert!(queue.take_kept(&own, &[JobKind::Train, kind], now + KEPT / 2));
        assert!(!queue.take_kept(&own, &[kind], now), "it is for one worker");
        queue.keep(&own, kind, now);
        assert!(!queue.take_kept(&own, &[kind], now + KEPT));
        (0..2 * KEPT_HINTS).for_each(|_| queue.keep(&own, kind, now));
        assert_eq!(queue.kept.len(), KEPT_HINTS);
    }

    #[test]
    fn a_hint_without_a_worker_is_kept() {
        let all = WaitingWorkers::default();
        all.wake(&Tenant::default(), JobKind::Render);
        assert_eq!(all.lock().kept.len(), 1);
    }

    #[tokio::test]
    async fn a_wait_ends_and_leaves_its_place() {
        let all = WaitingWorkers::default();
        let own = Tenant::default();
        let mut waits = Vec::new();
        for _ in 0..WORKERS {
            let mut wait = Box::pin(all.wait(&own, vec![JobKind::Train], LONG));
            assert_eq!((&mut wait).now_or_never(), None);
            waits.push(wait);
        }
        let none = Duration::ZERO;
        let full = all.wait(&own, vec![JobKind::Train], none).await;
        assert_eq!(full, Err(Busy));
        waits.pop();
        let timed_out = all.wait(&own, vec![JobKind::Train], none).await;
        assert_eq!(timed_out, Ok(false));
        assert_eq!(all.lock().workers.len(), WORKERS - 1);
    }
}
