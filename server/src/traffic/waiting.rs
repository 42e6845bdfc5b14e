//! Connections on which no call was admitted yet. When places are short they give way, so that a stranger who opens many connections
//! and says nothing keeps nobody out.

use super::Client;
use crate::capacity::{Owner, Places};
use std::collections::HashMap;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, PoisonError, Weak};

/// The connections without an admitted call, the oldest first.
#[derive(Debug, Default)]
pub(super) struct Waiting(Mutex<Vec<Weak<Client>>>);

impl Waiting {
    /// Adds a connection that begins.
    pub(super) fn add(&self, client: &Arc<Client>) {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        // Those that have ended or were admitted are taken out before the list would grow.
        if all.len() == all.capacity() {
            all.retain(|it| waits(it).is_some());
        }
        all.push(Arc::downgrade(client));
    }

    /// Ends a connection, and returns its place for one of `owner`. It is one of the owner with the most of them, unless that has no
    /// more than `owner` itself: then it is one of `owner`. The oldest that has no open call is the first to go.
    pub(super) fn give_way(&self, owner: Option<&Owner>) -> Option<Places> {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        all.retain(|it| waits(it).is_some());
        let clients: Vec<_> = all.iter().filter_map(waits).collect();
        let mut counts: HashMap<Option<&Owner>, usize> = HashMap::new();
        for client in &clients {
            *counts.entry(client.owner.as_ref()).or_default() += 1;
        }
        let own = counts.get(&owner).copied().unwrap_or_default();
        let (most, count) = counts.into_iter().max_by_key(|(_, count)| *count)?;
        let from = if count > own { most } else { owner };
        let theirs = || clients.iter().filter(|it| it.owner.as_ref() == from);
        let quiet = theirs().find(|it| it.calls.load(Ordering::SeqCst) == 0);
        let chosen = quiet.or_else(|| theirs().next())?;
        chosen.gives_way.cancel();
        let mut place = chosen.place.lock().unwrap_or_else(PoisonError::into_inner);
        place.take()
    }
}

/// The client, if it still has a place and no call of it was admitted.
fn waits(client: &Weak<Client>) -> Option<Arc<Client>> {
    let client = client.upgrade().filter(|it| !it.was_admitted())?;
    let place = client.place.lock().unwrap_or_else(PoisonError::into_inner);
    let has = place.is_some();
    drop(place);
    has.then_some(client)
}
