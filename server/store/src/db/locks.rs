//! The order of locks: a transaction takes them in the order of [`Lock`], and several of a kind by id. Two transactions that
//! keep to it never wait for each other.

/// What a transaction locks before it decides about it. A script that reads, decides and then writes takes the lock first:
/// otherwise the decision may be wrong by the time of the write.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Lock<'a> {
    /// The choice of the object store, which the first coordinator of a database makes.
    ObjectStore,
    /// The search for lost workers, which one of several coordinators does at a time.
    Reaping,
    /// The search for idle uploads and for rows that are older than their horizon.
    Forgetting,
    /// The end of the audit log.
    Audit,
    /// The quota of a tenant, with what the tenant uses of it.
    Quota(&'a str),
    /// A job, with its attempts, outputs, ranges and pins.
    Job(&'a str),
    /// A model, with its slots, checkpoints and the pins on them.
    Model(&'a str),
    /// A person, with the list of their captures.
    Subject(&'a str),
    /// A capture, with its files.
    Capture(&'a str),
}

/// The locks of a transaction. In builds with assertions, a wrong order is a panic, so that the tests find it even on a
/// database where nothing waits.
#[derive(Debug, Default)]
pub(super) struct Locks {
    #[cfg(debug_assertions)]
    held: std::collections::BTreeSet<(u8, String)>,
}

impl Locks {
    /// Records `lock`.
    #[cfg(debug_assertions)]
    pub(super) fn take(&mut self, lock: Lock<'_>) {
        let (kind, id) = match lock {
            Lock::ObjectStore => (0, ""),
            Lock::Reaping => (1, ""),
            Lock::Forgetting => (2, ""),
            Lock::Audit => (3, ""),
            Lock::Quota(tenant) => (4, tenant),
            Lock::Job(id) => (5, id),
            Lock::Model(id) => (6, id),
            Lock::Subject(id) => (7, id),
            Lock::Capture(id) => (8, id),
        };
        let lock = (kind, id.to_owned());
        let later = self.held.last().filter(|last| **last > lock);
        assert!(
            later.is_none() || self.held.contains(&lock),
            "{lock:?} is locked after {later:?}"
        );
        self.held.insert(lock);
    }

    /// Records nothing.
    #[cfg(not(debug_assertions))]
    pub(super) fn take(&mut self, _: Lock<'_>) {}
}

#[cfg(all(test, debug_assertions))]
mod tests {
    use super::*;

    #[test]
    fn a_lock_may_be_taken_twice_and_in_order() {
        let mut locks = Locks::default();
        for lock in [
            Lock::Job("z"),
            Lock::Model("a"),
            Lock::Model("b"),
            Lock::Capture("a"),
            Lock::Model("a"),
        ] {
            locks.take(lock);
        }
    }

    #[test]
    #[should_panic(expected = "is locked after")]
    fn a_wrong_order_is_found() {
        let mut locks = Locks::default();
        locks.take(Lock::Model("b"));
        locks.take(Lock::Model("a"));
    }
}
