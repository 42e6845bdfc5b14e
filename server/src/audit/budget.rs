//! How many refused calls of a caller the audit log lists. A call has its first entry before anybody knows how it ends, so a caller who
//! is refused again and again would make the log grow without end. Calls beyond the budget are not carried out, and are counted:
//! one entry has their number.

use crate::capacity::{Bucket, Filling, Owner};
use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;
use yoto_request::{Caller, RequestError};
use yoto_store::NewAuditEntry;

/// Time in which an empty budget is full again, seconds. With the default, one refused call per 10 s is listed, or 8 MB of log per day.
const REFILL: f64 = 10_000.0;

/// Refused calls of a key that are listed, `most` of them at once.
pub(crate) fn of_key(most: u32) -> Filling {
    Filling {
        most: most.into(),
        per_second: f64::from(most) / REFILL,
    }
}

/// The same of all keys of a tenant together: one key can't use it up.
pub(crate) fn of_tenant(most: u32) -> Filling {
    of_key(most.saturating_mul(2))
}

/// What stands as the call of an entry that counts calls.
const COUNTED: &str = "refused calls beyond the budget";

/// The budgets of this process.
#[derive(Debug)]
pub(super) struct Budget {
    most: u32,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    buckets: HashMap<Owner, Bucket>,
    /// Calls that were not carried out, by tenant and key.
    counted: HashMap<(String, String), u64>,
}

impl Budget {
    /// Full budgets of `most` refused calls for each key.
    pub(super) fn new(most: u32) -> Self {
        Self {
            most,
            state: Mutex::default(),
        }
    }

    fn owners(&self, caller: &Caller) -> [(Owner, Filling); 2] {
        let key = caller.key().unwrap_or_default();
        [
            (Owner::Tenant(caller.id().into()), of_tenant(self.most)),
            // Without keys, all calls are those of one.
            (Owner::Key(key.into()), of_key(self.most)),
        ]
    }

    /// Checks that the caller has something left, and counts the call if not.
    ///
    /// # Errors
    /// When nothing is left.
    pub(super) fn check(&self, caller: &Caller, now: Instant) -> Result<(), RequestError> {
        let mut state = self.state();
        for (owner, filling) in self.owners(caller) {
            let has = (state.buckets.get_mut(&owner)).is_none_or(|it| it.has(filling, now));
            if !has {
                let key = caller.key().unwrap_or_default();
                let counted = (caller.id().to_owned(), key.to_owned());
                *state.counted.entry(counted).or_default() += 1;
                return Err(RequestError::Busy(format!(
                    "{owner} has had too many calls refused, which the audit log lists: call again in {} s",
                    (1.0 / filling.per_second).ceil()
                )));
            }
        }
        Ok(())
    }

    /// Notes that a call of the caller was refused.
    pub(super) fn spend(&self, caller: &Caller, now: Instant) {
        let mut state = self.state();
        for (owner, filling) in self.owners(caller) {
            let bucket = state.buckets.entry(owner);
            let bucket = bucket.or_insert_with(|| Bucket::full(filling, now));
            bucket.has(filling, now);
            bucket.spend();
        }
    }

    /// Entries with the numbers of the calls that were counted since the last time.
    pub(super) fn counted(&self, now: Instant) -> Vec<NewAuditEntry> {
        let mut state = self.state();
        state.buckets.retain(|owner, bucket| {
            let filling = match owner {
                Owner::Tenant(_) => of_tenant(self.most),
                _ => of_key(self.most),
            };
            !bucket.is_full(filling, now)
        });
        let counted = std::mem::take(&mut state.counted).into_iter();
        let entries = counted.map(|((tenant, key), count)| NewAuditEntry {
            tenant,
            key,
            call: COUNTED.to_owned(),
            names: String::new(),
            began: None,
            outcome: format!("COUNTED {count}"),
        });
        entries.collect()
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;
    use yoto_store::Tenant;

    fn caller(key: &str) -> Caller {
        Caller::with_key(Tenant::new("lab").expect("a tenant"), key.into())
    }

    /// Refused calls that are listed, of `count`.
    fn listed(budget: &Budget, caller: &Caller, now: Instant, count: usize) -> usize {
        let admitted = (0..count).filter(|_| {
            let admitted = budget.check(caller, now).is_ok();
            if admitted {
                budget.spend(caller, now);
            }
            admitted
        });
        admitted.count()
    }

    #[test]
    fn refused_calls_beyond_the_budget_are_counted() {
        let (budget, now) = (Budget::new(1000), Instant::now());
        let (greedy, other) = (caller("greedy"), caller("other"));
        assert_eq!(listed(&budget, &greedy, now, 9000), 1000);
        assert_eq!(listed(&budget, &other, now, 500), 500, "has its own");
        let later = now + Duration::from_secs(60);
        assert_eq!(listed(&budget, &greedy, later, 1000), 6);
        let entries = budget.counted(later);
        assert_eq!(entries.len(), 1);
        assert_eq!(
            (entries[0].key.as_str(), entries[0].outcome.as_str()),
            ("greedy", "COUNTED 8994")
        );
        assert!(budget.counted(later).is_empty());
        // Keys that were made for more budget share the tenant's.
        let many = (0..20).map(|key| listed(&budget, &caller(&key.to_string()), later, 1000));
        assert!(
            (400..=520).contains(&many.sum::<usize>()),
            "what the tenant has left"
        );
        // What is full is forgotten.
        budget.counted(later + Duration::from_secs(36_000));
        assert!(budget.state().buckets.is_empty());
    }

    #[test]
    fn a_caller_who_is_not_refused_needs_no_budget() {
        let (budget, now) = (Budget::new(1000), Instant::now());
        assert!((0..9000).all(|_| budget.check(&caller("good"), now).is_ok()));
        assert!(budget.state().buckets.is_empty());
    }
}
