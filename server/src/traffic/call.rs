//! A call, from its start to the end of its response stream.

use super::{Client, Traffic, busy};
use crate::capacity::{Owner, Places, Pool};
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use tokio::sync::OwnedSemaphorePermit;
use tokio::time::Instant;
use yoto_proto::v1::Scope;
use yoto_request::{Caller, RequestError};

/// An open call. It is in the extensions of its request.
#[derive(Debug)]
pub(crate) struct Call {
    traffic: Arc<Traffic>,
    /// `None` if the transport does not identify its client.
    client: Option<Arc<Client>>,
    /// Its place among all calls; a probe has none.
    _place: Option<OwnedSemaphorePermit>,
    /// Its places in pools.
    places: Mutex<Vec<Places>>,
    /// Who makes it, once that is known.
    owners: OnceLock<Vec<Owner>>,
}

impl Call {
    pub(super) fn begin(
        traffic: Arc<Traffic>,
        client: Option<Arc<Client>>,
        place: Option<OwnedSemaphorePermit>,
    ) -> Self {
        if let Some(client) = &client {
            client.calls.fetch_add(1, Ordering::SeqCst);
        }
        Self {
            traffic,
            client,
            _place: place,
            places: Mutex::default(),
            owners: OnceLock::new(),
        }
    }

    /// Counts the call of a caller in this process, which has no share.
    ///
    /// # Errors
    /// When all connections are taken.
    pub(crate) fn of_process(&self) -> Result<(), RequestError> {
        self.take_connection(&[])
    }

    /// Counts the call of a caller who was admitted, for a path that needs `scope`. A `download` holds an open file.
    ///
    /// # Errors
    /// When the caller has its share of the connections, calls or downloads already.
    pub(crate) fn admitted(
        &self,
        caller: &Caller,
        scope: Option<Scope>,
        download: bool,
    ) -> Result<(), RequestError> {
        let key = caller.key().map(|key| Owner::Key(key.into()));
        let owners: Vec<_> = [Owner::Tenant(caller.id().into())]
            .into_iter()
            .chain(key)
            .collect();
        self.take_connection(&owners)?;
        let pools = &self.traffic.pools;
        let calls = match scope {
            Some(Scope::Work) => &pools.worker_calls,
            Some(Scope::Operate) => &pools.operator_calls,
            _ => &pools.user_calls,
        };
        self.take(calls, &owners)?;
        if download {
            self.take(&pools.downloads, &owners)?;
        }
        // Set once: a call is admitted once.
        let _ = self.owners.set(owners);
        Ok(())
    }

    /// Counts a call that needs no key.
    ///
    /// # Errors
    /// When too many are open, of the address if that is known.
    pub(crate) fn open_to_all(&self) -> Result<(), RequestError> {
        let address = self.client.as_ref().and_then(|it| it.owner.clone());
        let owners: Vec<_> = address.into_iter().collect();
        self.take(&self.traffic.pools.open_calls, &owners)
    }

    /// The client of its connection.
    pub(super) fn client(&self) -> Option<&Arc<Client>> {
        self.client.as_ref()
    }

    /// Who makes the call; empty if nobody was admitted.
    pub(super) fn owners(&self) -> &[Owner] {
        self.owners.get().map(Vec::as_slice).unwrap_or_default()
    }

    fn take_connection(&self, owners: &[Owner]) -> Result<(), RequestError> {
        let Some(client) = &self.client else {
            return Ok(());
        };
        let taken = client.admitted(&self.traffic.pools.connections, owners);
        taken.map_err(|error| busy(error.to_string()))
    }

    fn take(&self, pool: &Arc<Pool>, owners: &[Owner]) -> Result<(), RequestError> {
        let places = pool.take(owners, 1);
        let places = places.map_err(|error| busy(error.to_string()))?;
        self.places().push(places);
        Ok(())
    }

    fn places(&self) -> MutexGuard<'_, Vec<Places>> {
        self.places.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Call {
    fn drop(&mut self) {
        if let Some(client) = &self.client {
            let since = client.quiet_since.lock();
            *since.unwrap_or_else(PoisonError::into_inner) = Instant::now();
            client.calls.fetch_sub(1, Ordering::SeqCst);
        }
    }
}
