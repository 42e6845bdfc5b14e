//! A job that runs while its database is brought up to date: by a take-over, by a later step, and by both at once.

use super::Sqlite;
use super::migrations::steps;
use super::upgrade_tests::{before, open, plain};
use crate::Store;
use crate::db::schema::with_a_later_step;
use crate::db::taken_over::NOW;
use crate::db::{Database, Driver};
use crate::stage::{running_job_goes_on, taken_back_from_the_process_before};
use sqlx::{Executor, Row};
use std::path::Path;
use std::sync::Arc;
use yoto_process::clock::ManualClock;

/// The file, opened by a program that is newer by one step.
async fn open_later(path: &Path) -> Store {
    let opened = Sqlite::open_with(path, &with_a_later_step(steps())).await;
    Store::of(Database {
        driver: Driver::Sqlite(opened.expect("brings it up to date")),
        clock: Arc::new(ManualClock::at(NOW)),
    })
}

/// A training that runs, and what becomes of it once the later program has opened its database, with or without this one before
/// it.
async fn after_each_upgrade(more: &str, check: impl AsyncFn(&Store)) {
    for this_one_first in [false, true] {
        let (_folder, path) = before(more).await;
        if this_one_first {
            open(&path).await.expect("takes over").close().await;
        }
        let store = open_later(&path).await;
        check(&store).await;
        store.close().await;
        let pool = plain(&path).await;
        let later = pool.fetch_one("SELECT later FROM jobs WHERE id = 'j'");
        let later: i64 = later.await.expect("has the column").get("later");
        assert_eq!(later, 7);
    }
}

#[tokio::test]
async fn a_running_job_goes_on_after_each_upgrade() {
    after_each_upgrade("", async |store| running_job_goes_on(store).await).await;
}

#[tokio::test]
async fn a_job_of_the_process_before_the_upgrade_is_taken_back() {
    let embedded = "UPDATE workers SET embedded = 1";
    after_each_upgrade(embedded, async |store| {
        taken_back_from_the_process_before(store).await;
    })
    .await;
}

#[tokio::test]
async fn a_job_of_the_process_before_the_take_over_is_taken_back() {
    let (_folder, path) = before("UPDATE workers SET embedded = 1").await;
    let store = open(&path).await.expect("takes over");
    taken_back_from_the_process_before(&store).await;
    store.close().await;
}

#[tokio::test]
async fn a_later_step_leaves_those_that_have_the_file_and_lets_no_others_in() {
    let (_folder, path) = before("").await;
    let store = open(&path).await.expect("takes over");
    let later = open_later(&path).await;
    running_job_goes_on(&store).await;
    let refused = open(&path).await.expect_err("is newer").to_string();
    let last = steps().newest();
    assert!(
        refused.contains(&format!("has schema {}", last + 1))
            && refused.contains(&format!("up to {last}")),
        "{refused}"
    );
    later.close().await;
    store.close().await;
}
