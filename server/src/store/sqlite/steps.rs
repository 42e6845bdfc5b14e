//! The ages of rows, in time that the service spent: steps of the clock do not count.

use super::rows::{Columns, During};
use super::{SqliteStore, commit};
use crate::rules::retries;
use crate::rules::steps::{Reading, Step, while_down};
use crate::store::StoreError;
use sqlx::SqliteConnection;

/// Time after which a step is forgotten, seconds: a year, longer than any row is kept.
const KEEP: f64 = 366.0 * 24.0 * 3600.0;

/// Seconds that the service spent from the time stamp in `$column` until `?1`.
macro_rules! age {
    ($column:literal) => {
        concat!(
            "(?1 - ",
            $column,
            " - (SELECT total(seconds) FROM clock_steps WHERE at >= ",
            $column,
            "))"
        )
    };
}
pub(super) use age;

/// Records the time, and a step of the clock since the last call. Returns the time.
pub async fn keep_time(store: &SqliteStore) -> Result<f64, StoreError> {
    // Held until the step is recorded: no other call may find it as well.
    let mut first = store.first_reading.lock().await;
    let mut tx = store.write().await?;
    let reading = Reading {
        now: store.clock.now(),
        steady: store.clock.steady(),
    };
    let step = match *first {
        Some(first) => first.step_to(reading),
        None => (last_tick(&mut tx).await?).and_then(|it| while_down(it, reading.now)),
    };
    if let Some(step) = step {
        record(&mut tx, step, reading.now).await?;
        // A job waits while the service is down as well.
        if first.is_some() || step.seconds < 0.0 {
            let latest = reading.now + retries::LONGEST_WAIT;
            move_waits(&mut tx, step.seconds, latest).await?;
        }
    }
    tick(&mut tx, reading.now).await?;
    commit(tx).await?;
    if let (Some(step), true) = (step, first.is_some()) {
        let seconds = step.seconds;
        tracing::warn!(
            seconds,
            "the clock was set, or the machine slept: nothing ages by it"
        );
    }
    // Small differences add up until they are a step.
    let since = match (step, *first) {
        (None, Some(first)) => first,
        _ => *first.insert(reading),
    };
    Ok(since.expected(reading.steady))
}

/// When the service last looked at its clock; `None` before the first time.
async fn last_tick(conn: &mut SqliteConnection) -> Result<Option<f64>, StoreError> {
    let row = sqlx::query("SELECT last_tick FROM service_clock WHERE id = 1")
        .fetch_optional(conn)
        .await
        .during("reading when the clock was looked at")?;
    row.map_or(Ok(None), |row| row.real("last_tick"))
}

/// Records that the clock shows `now`.
async fn tick(conn: &mut SqliteConnection, now: f64) -> Result<(), StoreError> {
    sqlx::query(
        "INSERT INTO service_clock (id, last_tick) VALUES (1, ?1)
         ON CONFLICT (id) DO UPDATE SET last_tick = ?1",
    )
    .bind(now)
    .execute(conn)
    .await
    .during("recording the time")?;
    Ok(())
}

/// Time stamps that decide when something is deleted, and that nobody sees.
const STAMPS: [&str; 3] = [
    "UPDATE captures SET write_time = ?2 WHERE write_time > ?1",
    "UPDATE garbage SET first_seen = ?2 WHERE first_seen > ?1",
    "UPDATE request_ids SET create_time = ?2 WHERE create_time > ?1",
];
/// Seconds after a step at which a stamp is from after it.
const AFTER: f64 = 0.001;

/// Records a step, after which the clock shows `now`, and forgets old ones. Stamps that are in the future then become
/// stamps of now: the rows are kept for their whole time again, and not until the clock has caught up.
async fn record(conn: &mut SqliteConnection, step: Step, now: f64) -> Result<(), StoreError> {
    for stamps in STAMPS {
        sqlx::query(stamps)
            .bind(now)
            .bind(now + AFTER)
            .execute(&mut *conn)
            .await
            .during("correcting stamps of the future")?;
    }
    sqlx::query("DELETE FROM clock_steps WHERE at < ?1")
        .bind(now - KEEP)
        .execute(&mut *conn)
        .await
        .during("forgetting old steps of the clock")?;
    sqlx::query("INSERT INTO clock_steps (at, seconds) VALUES (?1, ?2)")
        .bind(step.at)
        .bind(step.seconds)
        .execute(conn)
        .await
        .during("recording a step of the clock")?;
    Ok(())
}

/// Moves the times before which postponed jobs wait by `seconds`; none is later than `latest`.
async fn move_waits(
    conn: &mut SqliteConnection,
    seconds: f64,
    latest: f64,
) -> Result<(), StoreError> {
    sqlx::query(
        "UPDATE jobs SET not_before = min(not_before + ?1, ?2)
         WHERE state = 'QUEUED' AND not_before IS NOT NULL",
    )
    .bind(seconds)
    .bind(latest)
    .execute(conn)
    .await
    .during("moving the waits of postponed jobs")?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::clock::ManualClock;
    use crate::store::{Horizons, NewSubject, RequestKey, SqliteStore, Store};
    use std::sync::Arc;

    const DAY: f64 = 24.0 * 3600.0;
    const WEEK: Horizons = Horizons {
        request_ids: 7.0 * DAY,
        attempts: 7.0 * DAY,
        workers: 7.0 * DAY,
    };

    #[tokio::test]
    async fn a_request_is_remembered_for_a_week_that_the_service_spent() {
        let dir = tempfile::tempdir().expect("a folder");
        let clock = Arc::new(ManualClock::at(1e9));
        let own = Arc::clone(&clock);
        let opened = SqliteStore::open(&dir.path().join("yoto.db"), own).await;
        let store = opened.expect("opens");
        store.keep_time().await.expect("writes");
        let request = RequestKey {
            method: "CreateSubject",
            request_id: "once".to_owned(),
            body_sha256: String::new(),
        };
        let ada = NewSubject {
            display_name: "Ada".to_owned(),
            consent_note: String::new(),
        };
        let created = store.create_subject(ada, Some(request.clone())).await;
        created.expect("creates");
        clock.set_ahead(8.0 * DAY);
        assert_eq!(store.forget(WEEK).await.expect("forgets"), 0);
        let known = store.answered(Some(&request)).await.expect("reads");
        assert!(known.is_some());
        clock.advance(8.0 * DAY);
        assert_eq!(store.forget(WEEK).await.expect("forgets"), 1);
        let known = store.answered(Some(&request)).await.expect("reads");
        assert!(known.is_none());
    }
}
