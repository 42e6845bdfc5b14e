//! Ages of rows in the service's running time: steps of the clock are recorded, and do not count.

use super::ticks::Ticks;
use crate::StoreError;
use crate::db::{Tx, sql};
use crate::rules::retries;
use crate::rules::steps::{Reading, Step, since_another, while_down};

/// Time after which a step is forgotten, seconds: a year, longer than any row is kept.
const KEEP: f64 = 366.0 * 24.0 * 3600.0;

/// Seconds of running time from the time stamp in `$column` to `$1`.
macro_rules! age {
    ($column:literal) => {
        concat!(
            "($1 - ",
            $column,
            " - (SELECT coalesce(sum(seconds), 0.0) FROM clock_steps WHERE at >= ",
            $column,
            "))"
        )
    };
}
pub(super) use age;

/// The checks of the clock that a process has made.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Checks {
    /// Since when the clock has had no step: small differences add up from there until they are one.
    pub since: Reading,
    /// The last check.
    pub last: Reading,
}

/// Records the time of `reading`, and a step of the clock since the last check of this process, or of another one that has
/// checked after it. Returns the step, and the reading since which there was none.
pub(crate) async fn keep_time(
    tx: &mut Tx,
    checks: Option<Checks>,
    reading: Reading,
) -> Result<(Option<Step>, Reading), StoreError> {
    // Checks of several coordinators follow each other: each step is recorded once.
    Ticks::Clock.lock(tx).await?;
    let last = Ticks::Clock.last(tx).await?;
    let (step, since) = match (checks, last) {
        (Some(own), Some(last)) if last != own.last.now => {
            (since_another(last, own.last, reading), reading)
        }
        (Some(own), _) => match own.since.step_to(reading) {
            None => (None, own.since),
            step => (step, reading),
        },
        (None, last) => (last.and_then(|it| while_down(it, reading.now)), reading),
    };
    if let Some(step) = step {
        record(tx, step).await?;
        // Waits go on while the service is down, so they move only if it ran, or if the clock was set back.
        if checks.is_some() || step.seconds < 0.0 {
            let latest = reading.now + retries::LONGEST_WAIT;
            move_waits(tx, step.seconds, latest).await?;
        }
    }
    Ticks::Clock.record(tx).await?;
    Ok((step, since))
}

/// End of the names of columns with time stamps on which deletions depend. Users do not see these stamps.
const STAMPS: &str = "_since";
/// Seconds from a step to a stamp that counts as made after it.
const AFTER: f64 = 0.001;

/// Records a step, which ends now, and forgets old steps. Stamps later than that are set to it, so
/// that their rows are kept for their full time again. Otherwise they would be kept until the clock catches up.
async fn record(tx: &mut Tx, step: Step) -> Result<(), StoreError> {
    for (table, column) in tx.columns_named(STAMPS).await? {
        sql(format!(
            "UPDATE {table} SET {column} = $2 WHERE {column} > $1"
        ))
        .bind(tx.now())
        .bind(tx.now() + AFTER)
        .execute(tx, "correcting time stamps in the future")
        .await?;
    }
    sql("DELETE FROM clock_steps WHERE at < $1")
        .bind(tx.now() - KEEP)
        .execute(tx, "forgetting old steps of the clock")
        .await?;
    sql("INSERT INTO clock_steps (at, seconds) VALUES ($1, $2)")
        .bind(step.at)
        .bind(step.seconds)
        .execute(tx, "recording a step of the clock")
        .await?;
    Ok(())
}

/// Moves the times until which postponed jobs wait by `seconds`, but to `latest` at most.
async fn move_waits(tx: &mut Tx, seconds: f64, latest: f64) -> Result<(), StoreError> {
    sql(
        "UPDATE jobs SET not_before = CASE WHEN not_before + $1 < $2 THEN not_before + $1 ELSE $2 END
         WHERE state = 'QUEUED' AND not_before IS NOT NULL",
    )
    .bind(seconds)
    .bind(latest)
    .execute(tx, "moving the waits of postponed jobs").await?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::STAMPS;
    use crate::stage::{DatabaseKind, on_each_database};
    use crate::{Horizons, NewSubject, RequestKey, Tenant};
    use std::sync::Arc;
    use yoto_process::clock::ManualClock;

    const DAY: f64 = 24.0 * 3600.0;
    const WEEK: Horizons = Horizons {
        request_ids: 7.0 * DAY,
        attempts: 7.0 * DAY,
        workers: 7.0 * DAY,
        audit: None,
    };

    on_each_database!(
        the_stamps_are_those_of_the_schema,
        a_request_is_remembered_for_a_week_of_running_time,
    );

    async fn the_stamps_are_those_of_the_schema(kind: DatabaseKind) {
        let clock = Arc::new(ManualClock::at(1e9));
        let staged = kind.store(clock).await;
        let store = &staged.store;
        let mut tx = store.db.read().await.expect("reads");
        let mut stamps = tx.columns_named(STAMPS).await.expect("reads");
        stamps.sort();
        let stamps: Vec<(&str, &str)> = stamps.iter().map(|(a, b)| (&**a, &**b)).collect();
        let expected = [
            ("captures", "idle_since"),
            ("garbage", "garbage_since"),
            ("request_ids", "kept_since"),
        ];
        assert_eq!(stamps, expected);
    }

    async fn a_request_is_remembered_for_a_week_of_running_time(kind: DatabaseKind) {
        let clock = Arc::new(ManualClock::at(1e9));
        let own = Arc::clone(&clock);
        let staged = kind.store(own).await;
        let store = &staged.store;
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
        let created = store
            .create_subject(&Tenant::default(), ada, Some(request.clone()))
            .await;
        created.expect("creates");
        clock.set_ahead(8.0 * DAY);
        assert_eq!(store.forget(WEEK).await.expect("forgets"), 0);
        let known = store
            .answered(&Tenant::default(), Some(&request))
            .await
            .expect("reads");
        assert!(known.is_some());
        clock.advance(8.0 * DAY);
        assert_eq!(store.forget(WEEK).await.expect("forgets"), 1);
        let known = store
            .answered(&Tenant::default(), Some(&request))
            .await
            .expect("reads");
        assert!(known.is_none());
    }
}
