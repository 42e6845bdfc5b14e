//! Jobs that have ended and whose traces were not sent yet.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};
use yoto_process::metrics::METRICS;

/// Most jobs that wait.
const MOST: usize = 1024;

/// Names of ended jobs, oldest first. Beyond [`MOST`] the oldest are dropped, and counted.
#[derive(Debug, Default)]
pub(crate) struct EndedJobs(Mutex<VecDeque<String>>);

impl EndedJobs {
    /// The job called `jobs/{id}` has ended, or may have.
    pub(crate) fn note(&self, job: &str) {
        let mut waiting = self.waiting();
        if waiting.iter().any(|it| it == job) {
            return;
        }
        if waiting.len() == MOST {
            waiting.pop_front();
            METRICS.traces_dropped(1);
        }
        waiting.push_back(job.to_owned());
    }

    /// Takes the `most` oldest jobs.
    pub(crate) fn take(&self, most: usize) -> Vec<String> {
        let mut waiting = self.waiting();
        let most = most.min(waiting.len());
        waiting.drain(..most).collect()
    }

    /// Puts back what [`Self::take`] has taken, as far as there is room.
    pub(crate) fn put_back(&self, taken: Vec<String>) {
        let mut waiting = self.waiting();
        let room = MOST - waiting.len();
        let beyond = taken.len().saturating_sub(room);
        METRICS.traces_dropped(beyond);
        for job in taken.into_iter().skip(beyond).rev() {
            waiting.push_front(job);
        }
    }

    /// How many wait.
    pub(crate) fn len(&self) -> usize {
        self.waiting().len()
    }

    fn waiting(&self) -> MutexGuard<'_, VecDeque<String>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_are_dropped_and_each_job_waits_once() {
        let ended = EndedJobs::default();
        for i in 0..MOST + 2 {
            ended.note(&format!("jobs/{i}"));
            ended.note(&format!("jobs/{i}"));
        }
        assert_eq!(ended.len(), MOST);
        let taken = ended.take(3);
        assert_eq!(taken, ["jobs/2", "jobs/3", "jobs/4"]);
        ended.note("jobs/new");
        ended.put_back(taken);
        assert_eq!(ended.len(), MOST);
        assert_eq!(ended.take(2), ["jobs/3", "jobs/4"]);
    }
}
