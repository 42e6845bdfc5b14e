//! A number of places that owners share, of which a newcomer always finds one.
//!
//! The rule is the dynamic threshold of shared buffers (Choudhury and Hahne, IEEE/ACM Transactions on Networking 6(2), 1998): an owner
//! may hold as many places as are free. One owner alone gets a half, two get a third each, and n get 1/(n + 1) each. So no share has
//! to be set in advance, and the rest is the reserve of the next owner.

use super::Owner;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use thiserror::Error;

/// Places that owners share.
#[derive(Debug)]
pub(crate) struct Pool {
    /// What a place is, in the plural, such as "open calls".
    what: &'static str,
    total: usize,
    taken: Mutex<Taken>,
}

#[derive(Debug, Default)]
struct Taken {
    all: usize,
    by: HashMap<Owner, usize>,
}

impl Taken {
    fn note(&mut self, owners: &[Owner], count: usize) {
        self.all += count;
        for owner in owners {
            *self.by.entry(owner.clone()).or_default() += count;
        }
    }

    fn give_back(&mut self, owners: &[Owner], count: usize) {
        self.all -= count;
        for owner in owners {
            if let Some(held) = self.by.get_mut(owner) {
                *held -= count;
                if *held == 0 {
                    self.by.remove(owner);
                }
            }
        }
    }
}

/// Why there is no place.
#[derive(Debug, Error, PartialEq, Eq)]
pub(crate) enum NoPlace {
    /// An owner has its share already.
    #[error("{owner} has {held} of {total} {what}, and the rest is for others")]
    Share {
        owner: Owner,
        held: usize,
        total: usize,
        what: &'static str,
    },
    /// All are taken.
    #[error("all {total} {what} are taken")]
    Full { total: usize, what: &'static str },
}

/// Places of some owners, until they are dropped.
#[derive(Debug)]
pub(crate) struct Places {
    pool: Arc<Pool>,
    owners: Vec<Owner>,
    count: usize,
}

impl Pool {
    /// `total` free places.
    pub(crate) fn new(what: &'static str, total: usize) -> Arc<Self> {
        Arc::new(Self {
            what,
            total,
            taken: Mutex::default(),
        })
    }

    /// Takes `count` places, which count for each of the `owners`.
    ///
    /// # Errors
    /// When an owner would have more than its share, or all are taken.
    pub(crate) fn take(
        self: &Arc<Self>,
        owners: &[Owner],
        count: usize,
    ) -> Result<Places, NoPlace> {
        let mut taken = self.taken();
        let (total, what) = (self.total, self.what);
        let free = total.saturating_sub(taken.all);
        if count > free {
            return Err(NoPlace::Full { total, what });
        }
        for owner in owners {
            let held = taken.by.get(owner).copied().unwrap_or_default();
            if held + count > owner.share_of(free) {
                return Err(NoPlace::Share {
                    owner: owner.clone(),
                    held,
                    total,
                    what,
                });
            }
        }
        taken.note(owners, count);
        drop(taken);
        Ok(self.places(owners, count))
    }

    /// Gives places of others to `owners`, whose share they may exceed.
    pub(crate) fn hand_over(self: &Arc<Self>, mut places: Places, owners: &[Owner]) -> Places {
        let count = std::mem::take(&mut places.count);
        let mut taken = self.taken();
        taken.give_back(&places.owners, count);
        taken.note(owners, count);
        drop(taken);
        self.places(owners, count)
    }

    fn places(self: &Arc<Self>, owners: &[Owner], count: usize) -> Places {
        Places {
            pool: Arc::clone(self),
            owners: owners.to_vec(),
            count,
        }
    }

    fn taken(&self) -> MutexGuard<'_, Taken> {
        self.taken.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Places {
    /// Adds places of the same owners.
    ///
    /// # Errors
    /// As [`Pool::take`]; the places before stay.
    pub(crate) fn add(&mut self, count: usize) -> Result<(), NoPlace> {
        let mut more = self.pool.take(&self.owners, count)?;
        self.count += std::mem::take(&mut more.count);
        Ok(())
    }
}

impl Drop for Places {
    fn drop(&mut self) {
        self.pool.taken().give_back(&self.owners, self.count);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tenant(name: &str) -> Owner {
        Owner::Tenant(name.into())
    }

    fn fill(pool: &Arc<Pool>, owners: &[Owner]) -> Vec<Places> {
        std::iter::from_fn(|| pool.take(owners, 1).ok()).collect()
    }

    #[test]
    fn an_owner_alone_gets_a_half_and_newcomers_always_find_a_place() {
        let pool = Pool::new("open calls", 4096);
        let all: Vec<_> = (0..10)
            .map(|it| fill(&pool, &[tenant(&it.to_string())]))
            .collect();
        let counts: Vec<_> = all.iter().map(Vec::len).collect();
        assert_eq!(counts[..3], [2048, 1024, 512]);
        assert!(*counts.last().expect("ten") > 0);
        let refused = pool.take(&[tenant("0")], 1).expect_err("has its share");
        assert_eq!(
            refused.to_string(),
            "the tenant 0 has 2048 of 4096 open calls, and the rest is for others"
        );
        drop(all);
        assert_eq!(pool.taken().all, 0);
        assert!(
            pool.taken().by.is_empty(),
            "owners without places are forgotten"
        );
    }

    #[test]
    fn owners_that_come_and_go_get_equal_shares() {
        let pool = Pool::new("open calls", 400);
        let mut held: Vec<Vec<Places>> = (0..3).map(|_| Vec::new()).collect();
        // Each place ends after a while, and its owner takes as many as it can.
        for round in 0..2000 {
            let own = &mut held[round % 3];
            if own.len() > 3 {
                own.drain(..own.len() / 10 + 1);
            }
            own.extend(fill(&pool, &[tenant(&(round % 3).to_string())]));
        }
        for own in &held {
            assert!((95..=110).contains(&own.len()), "{}", own.len());
        }
    }

    #[test]
    fn a_key_gets_half_of_what_its_tenant_may_have() {
        let pool = Pool::new("open calls", 300);
        let owners = |key: &str| [tenant("lab"), Owner::Key(key.into())];
        let one = fill(&pool, &owners("one"));
        assert_eq!(one.len(), 100);
        let two = fill(&pool, &owners("two"));
        assert!(
            !two.is_empty() && one.len() + two.len() <= 150,
            "{}",
            two.len()
        );
    }

    #[test]
    fn the_only_place_is_taken_once() {
        let pool = Pool::new("open calls", 1);
        let owners = [tenant("lab"), Owner::Key("one".into())];
        let first = pool.take(&owners, 1).expect("is free");
        assert!(pool.take(&owners, 1).is_err());
        drop(first);
        assert!(pool.take(&owners, 1).is_ok());
    }

    #[test]
    fn places_change_hands() {
        let pool = Pool::new("connections", 2);
        let first = pool.take(&[tenant("one")], 1).expect("is free");
        let _other = pool.take(&[tenant("three")], 1).expect("is free");
        let second = pool.hand_over(first, &[tenant("two")]);
        assert_eq!(pool.taken().all, 2);
        assert_eq!(pool.taken().by.get(&tenant("one")), None);
        assert_eq!(pool.taken().by.get(&tenant("two")), Some(&1));
        drop(second);
        assert_eq!(pool.taken().all, 1);
    }

    #[test]
    fn places_without_an_owner_end_with_the_last() {
        let pool = Pool::new("connections", 2);
        let both = fill(&pool, &[]);
        assert_eq!(both.len(), 2);
        let full = pool.take(&[], 1).expect_err("is full");
        assert_eq!(full.to_string(), "all 2 connections are taken");
    }

    #[test]
    fn places_are_added_and_given_back_together() {
        let pool = Pool::new("bytes", 100);
        let mut places = pool.take(&[tenant("lab")], 20).expect("is free");
        places.add(25).expect("is free");
        assert!(places.add(20).is_err(), "the rest is for others");
        assert_eq!(pool.taken().all, 45);
        drop(places);
        assert_eq!(pool.taken().all, 0);
    }
}
