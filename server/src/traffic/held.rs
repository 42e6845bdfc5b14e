//! The bytes of requests that a call counts for, until it is answered or asks for the next message.

use crate::capacity::{NoPlace, Owner, Places, Pool};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

/// The counted bytes of a call.
#[derive(Debug, Default)]
pub(super) struct Held(Mutex<Counted>);

#[derive(Debug, Default)]
struct Counted {
    /// Of those of the connection.
    own: Option<OwnedSemaphorePermit>,
    /// Of those of all connections.
    shared: Option<Places>,
}

impl Held {
    /// Takes `count` bytes from `of`, which are a connection's. Returns false if fewer are left.
    pub(super) fn take_own(&self, of: &Arc<Semaphore>, count: u32) -> bool {
        let Ok(permit) = Arc::clone(of).try_acquire_many_owned(count) else {
            return false;
        };
        let mut counted = self.counted();
        match &mut counted.own {
            Some(held) => held.merge(permit),
            own => *own = Some(permit),
        }
        true
    }

    /// Takes `count` bytes of all for `owners`, which are the same at each call.
    pub(super) fn take_shared(
        &self,
        of: &Arc<Pool>,
        owners: &[Owner],
        count: u32,
    ) -> Result<(), NoPlace> {
        let mut counted = self.counted();
        match &mut counted.shared {
            Some(held) => held.add(count as usize),
            shared => {
                *shared = Some(of.take(owners, count as usize)?);
                Ok(())
            }
        }
    }

    pub(super) fn clear(&self) {
        *self.counted() = Counted::default();
    }

    fn counted(&self) -> MutexGuard<'_, Counted> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
