//! Stores for tests, each in a database of its own of either kind.

use super::Store;
use crate::rules::retention::Retention;
use crate::{Ending, LeaseKey, Tenant};
use std::sync::Arc;
use tempfile::TempDir;
use yoto_process::clock::Clock;
use yoto_proto::v1::{Checkpoint, job};
use yoto_test_postgres::Database;

/// A kind of database.
#[derive(Debug, Clone, Copy)]
pub(crate) enum DatabaseKind {
    Sqlite,
    Postgres,
}

/// A store with its database, which goes with this value.
pub(crate) struct Staged {
    pub store: Store,
    _folder: Option<TempDir>,
    _database: Option<Database>,
}

/// Two stores on one database, as two coordinators have them. The database goes with this value.
pub(crate) struct Pair {
    pub first: Store,
    pub second: Store,
    _folder: Option<TempDir>,
    _database: Option<Database>,
}

impl DatabaseKind {
    /// Whether this machine has it; says so if it has not.
    pub(crate) fn is_there(self) -> bool {
        match self {
            Self::Sqlite => true,
            Self::Postgres => yoto_test_postgres::is_there(),
        }
    }

    /// A store in a new database.
    pub(crate) async fn store(self, clock: Arc<dyn Clock>) -> Staged {
        match self {
            Self::Sqlite => {
                let folder = tempfile::tempdir().expect("a folder");
                let store = Store::open_sqlite(&folder.path().join("yoto.db"), clock).await;
                Staged {
                    store: store.expect("opens"),
                    _folder: Some(folder),
                    _database: None,
                }
            }
            Self::Postgres => {
                let database = Database::create().expect("PostgreSQL");
                let url = database.url().parse().expect("an address");
                let store = Store::open_postgres(&url, clock).await;
                Staged {
                    store: store.expect("opens"),
                    _folder: None,
                    _database: Some(database),
                }
            }
        }
    }

    /// Two stores on a new database, which is empty for both.
    pub(crate) async fn pair(self, clock: Arc<dyn Clock>) -> Pair {
        match self {
            Self::Sqlite => {
                let folder = tempfile::tempdir().expect("a folder");
                let path = folder.path().join("yoto.db");
                let open = async || {
                    let opened = Store::open_sqlite(&path, Arc::clone(&clock)).await;
                    opened.expect("opens")
                };
                Pair {
                    first: open().await,
                    second: open().await,
                    _folder: Some(folder),
                    _database: None,
                }
            }
            Self::Postgres => {
                let database = Database::create().expect("PostgreSQL");
                let url = database.url().parse().expect("an address");
                let open = async || {
                    let opened = Store::open_postgres(&url, Arc::clone(&clock)).await;
                    opened.expect("opens")
                };
                let (first, second) = tokio::join!(open(), open());
                Pair {
                    first,
                    second,
                    _folder: None,
                    _database: Some(database),
                }
            }
        }
    }
}

/// Makes a test for each kind of database of each function, which takes the kind.
macro_rules! on_each_database {
    ($($test:ident),+ $(,)?) => {
        mod on_sqlite {
            $(#[tokio::test]
            async fn $test() {
                super::$test($crate::stage::DatabaseKind::Sqlite).await;
            })+
        }
        mod on_postgres {
            $(#[tokio::test]
            async fn $test() {
                let kind = $crate::stage::DatabaseKind::Postgres;
                if kind.is_there() {
                    super::$test(kind).await;
                }
            })+
        }
    };
}
pub(crate) use on_each_database;

/// The training `j` runs by the token 77 of the worker `w` in a database that was brought up to date: its lease lasts, and it
/// publishes and returns.
pub(crate) async fn running_job_goes_on(store: &Store) {
    let own = Tenant::default();
    let lease = LeaseKey {
        job_id: "j".into(),
        worker_id: "w".into(),
        token: 77,
    };
    assert!(store.tick(5, 20.0).await.expect("ticks").is_empty());
    let cancel = store.heartbeat(&own, &lease, None, 20.0).await;
    assert!(!cancel.expect("the lease lasts"));
    let job = store.job_history(&own, "j").await.expect("is kept");
    assert_eq!((job.state(), job.attempts.len()), (job::State::Running, 1));
    let checkpoint = Checkpoint {
        step: 5,
        ..Checkpoint::default()
    };
    let keep = Retention {
        newest: 1,
        every: 0,
    };
    let published = store
        .publish_checkpoint(&own, &lease, checkpoint, keep)
        .await;
    published.expect("publishes");
    let ended = store.end_job(&own, &lease, Ending::Returned).await;
    ended.expect("returns the job");
    let (keys, _) = store.all_keys().await.expect("reads");
    let keys: Vec<&str> = keys.iter().map(|it| &*it.id).collect();
    assert_eq!(keys, ["key"]);
    let known = store.require_worker_of_key(&own, "v", "key").await;
    known.expect("it has registered with the key");
    let known = store.require_worker_of_key(&own, "w", "key").await;
    known.expect_err("it has registered without a key");
}

/// The training `j` of a worker in the only coordinator of an earlier version goes back to the queue when a coordinator of
/// this version starts, whatever the coordinator's instance.
pub(crate) async fn taken_back_from_the_process_before(store: &Store) {
    let back = store.take_back_embedded("an instance", 5).await;
    let back: Vec<String> = (back.expect("takes back").into_iter())
        .map(|it| it.job)
        .collect();
    assert_eq!(back, ["jobs/j"]);
    let job = store.job(&Tenant::default(), "j").await.expect("is kept");
    assert_eq!((job.state(), job.lost_workers), (job::State::Queued, 1));
}
