//! Hints for those who would otherwise find a change at their next poll: watchers of jobs, and workers that wait for one.
//! Coordinators of one database send them to each other through it.
//!
//! A hint may be lost, and may come without a reason. Both cost time only: whoever gets one looks into the database, and
//! whoever gets none looks at the next poll.

mod message;
mod others;
mod waiting;

pub(crate) use message::Hint;
pub(crate) use others::{listen, send};
pub(crate) use waiting::Busy;

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use tokio::sync::Notify;
use waiting::WaitingWorkers;

/// Most hints of different jobs that wait to be sent. Others are left out.
const OUTGOING: usize = 10_000;

/// The hints of a coordinator.
#[derive(Debug, Default)]
pub(crate) struct Hints {
    /// Workers that wait for a job.
    pub waiting: WaitingWorkers,
    /// Hints for other coordinators; none if there can't be others.
    outgoing: Option<Outgoing>,
    /// Whether hints of other coordinators arrive.
    listening: AtomicBool,
}

/// Hints that are to be sent, with their number.
#[derive(Debug, Default)]
struct Outgoing {
    hints: Mutex<BTreeMap<Hint, u32>>,
    news: Notify,
}

impl Hints {
    /// Those of a coordinator beside `others`, or of the only one.
    pub(crate) fn new(others: bool) -> Self {
        Self {
            outgoing: others.then(Outgoing::default),
            ..Self::default()
        }
    }

    /// Sends a hint to other coordinators, soon.
    pub(crate) fn tell(&self, hint: Hint) {
        let Some(outgoing) = &self.outgoing else {
            return;
        };
        let mut hints = outgoing
            .hints
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        if hints.len() < OUTGOING || hints.contains_key(&hint) {
            *hints.entry(hint).or_default() += 1;
            outgoing.news.notify_one();
        }
    }

    /// Whether hints of other coordinators arrive.
    pub(crate) fn are_heard(&self) -> bool {
        self.listening.load(Ordering::Relaxed)
    }
}
