//! Injected faults, for tests that break a running service: the process ends at chosen moments of a call, calls
//! arrive several times, answers get lost.
//!
//! A coordinator without `ServerConfig::faults` has no layer around its calls, and its commits only
//! look at an empty task-local variable.

use std::fmt::Debug;
use std::future::Future;
use std::sync::Arc;
use std::time::Duration;

/// A moment of a call.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Moment {
    /// Its transaction is complete, and not yet committed.
    BeforeCommit,
    /// Its transaction is committed.
    AfterCommit,
    /// Its answer is ready, and not yet sent.
    BeforeReply,
}

/// How often and when a call arrives, and whether its answer does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Delivery {
    /// Number of times, at least 1, one after another.
    pub times: u32,
    /// Time from the answer until one more copy arrives, whose answer is dropped.
    pub late: Option<Duration>,
    /// Whether the caller gets the last answer; otherwise it gets UNAVAILABLE.
    pub answered: bool,
}

impl Delivery {
    /// One delivery, as without faults.
    pub const ONCE: Self = Self {
        times: 1,
        late: None,
        answered: true,
    };
}

/// What goes wrong, and when. Calls have the names of their methods, such as `EndJob`; only those with one
/// request and one answer are disturbed.
pub trait Faults: Debug + Send + Sync {
    /// A call has reached a moment; the process may end here.
    fn reached(&self, call: &str, moment: Moment);

    /// What happens to a call that arrives.
    fn delivery(&self, call: &str) -> Delivery;

    /// Whether a hint of another coordinator arrives.
    fn hears(&self) -> bool {
        true
    }
}

/// The call that a task serves, and its faults.
#[derive(Debug, Clone)]
pub struct Current {
    /// The name of its method.
    pub name: String,
    /// What goes wrong with it.
    pub faults: Arc<dyn Faults>,
}

tokio::task_local! {
    static CURRENT: Current;
}

impl Current {
    /// Runs `work` as work for this call: [`reached`] tells its faults.
    pub fn scope<F: Future>(self, work: F) -> impl Future<Output = F::Output> {
        CURRENT.scope(self, work)
    }
}

/// Tells the faults of this task's call, if there are any, about a moment.
pub fn reached(moment: Moment) {
    // Without faults, and outside of calls, nothing is set.
    let _ = CURRENT.try_with(|call| call.faults.reached(&call.name, moment));
}
