//! Health of the service: SERVING while writes to the database succeed and the object store answers, until the coordinator is
//! about to end.
//!
//! With a full disk or a locked file, reads still succeed, so each check writes: it records the time.

use crate::objects::Storage;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::watch;
use tokio::time::{sleep, timeout};
use tokio_util::sync::CancellationToken;
use tonic_health::ServingStatus;
use tonic_health::server::HealthReporter;
use yoto_objects::{Objects, ObjectsError};
use yoto_proto::v1::object_service_server::SERVICE_NAME as OBJECT_SERVICE;
use yoto_proto::v1::upload_service_server::SERVICE_NAME as UPLOAD_SERVICE;
use yoto_request::methods::services;
use yoto_store::Store;

/// Longest interval between two checks while something fails.
const RECHECK: Duration = Duration::from_secs(1);
/// Time limit of a check, in intervals between checks.
const PATIENCE: u32 = 2;

/// What the checks have found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Health {
    /// Whether the last write to the database succeeded.
    pub database: bool,
    /// Whether the object store has answered.
    pub objects: bool,
    /// Whether the coordinator is about to end: it still serves, but nobody should come any more.
    pub leaving: bool,
}

impl Default for Health {
    fn default() -> Self {
        Self {
            database: true,
            objects: true,
            leaving: false,
        }
    }
}

impl Health {
    /// Why nobody should come, in words for an operator; empty if all is well. The causes are in the log: strangers may read
    /// this.
    pub(crate) fn faults(self) -> Vec<&'static str> {
        let all = [
            (self.leaving, "this coordinator is ending"),
            (!self.database, "the database can't be written"),
            (!self.objects, "the object store does not answer"),
        ];
        let found = all.into_iter().filter(|(is_so, _)| *is_so);
        found.map(|(_, words)| words).collect()
    }

    /// The status of the service called `name`; of the server as a whole, whose name is empty. Only uploads and downloads
    /// need the object store.
    fn of(self, name: &str) -> ServingStatus {
        let needs_objects = [UPLOAD_SERVICE, OBJECT_SERVICE, ""].contains(&name);
        match self.database && !self.leaving && (self.objects || !needs_objects) {
            true => ServingStatus::Serving,
            false => ServingStatus::NotServing,
        }
    }
}

/// Sets the status of every service of the contract, and that of the server as a whole, whose name is empty.
pub(crate) async fn set(reporter: &HealthReporter, health: Health) {
    for name in services().chain([""]) {
        reporter.set_service_status(name, health.of(name)).await;
    }
}

/// Checks whether database and object store work.
pub(crate) struct HealthCheck {
    store: Arc<Store>,
    objects: Objects,
    storage: Arc<Storage>,
    found: watch::Sender<Health>,
}

impl HealthCheck {
    /// A check that has found nothing wrong yet.
    pub(crate) fn new(store: &Arc<Store>, objects: &Objects, storage: &Arc<Storage>) -> Self {
        Self {
            store: Arc::clone(store),
            objects: objects.clone(),
            storage: Arc::clone(storage),
            found: watch::Sender::default(),
        }
    }

    /// What was found last.
    pub(crate) fn found(&self) -> Health {
        *self.found.borrow()
    }

    /// Changes what is known. Returns whether that was news.
    fn change(&self, change: impl FnOnce(&mut Health)) -> bool {
        self.found.send_if_modified(|known| {
            let before = *known;
            change(known);
            *known != before
        })
    }

    /// Says from now on that the coordinator is about to end.
    pub(crate) fn leave(&self) {
        self.change(|health| health.leaving = true);
    }

    /// Writes the time to the database and asks the object store at each interval, and records whether that succeeded, until
    /// `stop`.
    pub(crate) async fn run(self: Arc<Self>, every: Duration, stop: CancellationToken) {
        loop {
            let known = self.found();
            let pause = match known.database && known.objects {
                true => every,
                false => every.min(RECHECK),
            };
            tokio::select! {
                () = stop.cancelled() => return,
                () = sleep(pause) => {}
            }
            let limit = every * PATIENCE;
            tokio::join!(self.check_database(limit), self.check_objects(limit));
        }
    }

    async fn check_database(&self, limit: Duration) {
        // Not cancelled at the limit: whether a step of the clock was recorded would be unknown.
        let write = self.store.keep_time();
        tokio::pin!(write);
        let written = match timeout(limit, &mut write).await {
            Ok(written) => written,
            Err(late) => {
                self.found_database(Some(&late));
                write.await
            }
        };
        match written {
            Ok(_) => self.found_database(None),
            Err(error) => self.found_database(Some(&error)),
        }
    }

    async fn check_objects(&self, limit: Duration) {
        let asked = timeout(limit, self.objects_answer()).await;
        let fault: Option<&dyn std::error::Error> = match &asked {
            Ok(Ok(())) => None,
            Ok(Err(error)) => Some(error),
            Err(late) => Some(late),
        };
        let works = fault.is_none();
        match fault {
            _ if !self.change(|health| health.objects = works) => {}
            None => tracing::info!("the object store answers again"),
            Some(error) => tracing::error!(%error, "the object store does not answer"),
        }
    }

    /// Asks the object store for something that it does not have.
    async fn objects_answer(&self) -> Result<(), ObjectsError> {
        self.objects.answers().await?;
        // A folder that is no longer there has no object either.
        self.storage.place.is_there().await
    }

    /// Records the outcome of a write. A change is logged, and reaches all listeners.
    fn found_database(&self, fault: Option<&dyn std::error::Error>) {
        let works = fault.is_none();
        match fault {
            _ if !self.change(|health| health.database = works) => {}
            None => tracing::info!("the database can be written again: the service is healthy"),
            Some(error) => {
                tracing::error!(%error, "the database can't be written: the service is not healthy");
            }
        }
    }

    /// Sets the status of every service to what [`Self::run`] finds. Never returns.
    pub(crate) async fn follow(&self, reporter: &HealthReporter) {
        let mut health = self.found.subscribe();
        loop {
            let known = *health.borrow_and_update();
            set(reporter, known).await;
            if health.changed().await.is_err() {
                // Unreachable: this check owns the sender.
                std::future::pending::<()>().await;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_service_is_not_serving_without_what_it_needs() {
        let all = Health::default();
        let told = |health: Health| {
            ["", UPLOAD_SERVICE, "yoto.v1.JobService"]
                .map(|name| health.of(name) == ServingStatus::Serving)
        };
        assert_eq!(told(all), [true; 3]);
        let objects = Health {
            objects: false,
            ..all
        };
        assert_eq!(told(objects), [false, false, true]);
        let database = Health {
            database: false,
            ..all
        };
        assert_eq!(told(database), [false; 3]);
        let leaving = Health {
            leaving: true,
            ..all
        };
        assert_eq!(told(leaving), [false; 3]);
        assert_eq!(leaving.faults(), ["this coordinator is ending"]);
    }
}
