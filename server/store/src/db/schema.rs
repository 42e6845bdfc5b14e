//! Whether a database is one that this program may bring up to date.

use crate::StoreError;
use sha2::{Digest, Sha256};
use sqlx::SqlSafeStr;
use sqlx::migrate::{Migration, MigrationType, Migrator};

/// The table with the steps that were applied.
pub(super) const APPLIED: &str = "_sqlx_migrations";
/// Number of the step that makes the whole schema. Programs that made it by the steps before refuse a schema of this number
/// as a newer one.
pub(super) const START: i64 = 39;
/// The last of the steps that the start replaces: they made the same schema.
const REPLACED: i64 = START - 1;
/// A program that brings earlier schemas up to [`REPLACED`].
const BEFORE: &str = "the program of 28 November 2026 (commit 5ce29de0)";

/// Forgets the records of the steps that the start `$1` replaces.
pub(super) const FORGET: &str = "DELETE FROM _sqlx_migrations WHERE version < $1";
/// Records the start `$1` with its name and its checksum.
pub(super) const RECORD: &str =
    "INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time)
    VALUES ($1, $2, TRUE, $3, 0) ON CONFLICT (version) DO NOTHING";

/// The steps that make a database's schema.
#[derive(Debug)]
pub(crate) struct Steps {
    /// The step [`START`].
    pub start: Migration,
    /// The steps after it.
    pub later: Vec<Migration>,
    /// The [`digest`] of all steps that the start replaces.
    pub replaced: String,
}

/// What a database contains before it is brought up to date.
#[derive(Debug, Default)]
pub(super) struct FoundSchema {
    /// Names of its tables.
    pub tables: Vec<String>,
    /// Number and checksum of each applied step, by number.
    pub applied: Vec<(i64, Vec<u8>)>,
}

/// How far a database is that this program may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum State {
    /// It has the schema of this program.
    Current,
    /// It is empty, or later steps are missing.
    Behind,
    /// It has the schema of the start by the steps that the start replaces: their records have to be replaced too.
    Replaced,
}

impl Steps {
    /// The start alone.
    #[cfg(test)]
    pub(crate) fn start_alone(mut self) -> Self {
        self.later.clear();
        self
    }

    /// Applies the steps that are missing.
    pub(super) fn migrator(&self) -> Migrator {
        let start = std::iter::once(&self.start);
        Migrator::with_migrations(start.chain(&self.later).cloned().collect())
    }

    /// The schema that a database has in the end.
    pub(super) fn newest(&self) -> i64 {
        self.later.last().unwrap_or(&self.start).version
    }
}

/// A step in a transaction.
pub(super) fn step(version: i64, name: &'static str, sql: &'static str) -> Migration {
    let kind = MigrationType::Simple;
    Migration::new(version, name.into(), kind, sql.into_sql_str(), false)
}

/// SHA-256 of the numbers and checksums of steps, hex.
fn digest(applied: &[(i64, Vec<u8>)]) -> String {
    let mut hash = Sha256::new();
    for (version, checksum) in applied {
        hash.update(version.to_be_bytes());
        hash.update(checksum);
    }
    yoto_proto::hex(&hash.finalize())
}

/// How far a database is. Refuses one of another program, of a newer version of this one, or of a version that is too early.
///
/// # Errors
/// [`StoreError::Unusable`].
pub(super) fn state(steps: &Steps, found: &FoundSchema) -> Result<State, StoreError> {
    let refused = |reason: String| Err(StoreError::Unusable(reason));
    let Some((last, _)) = found.applied.last() else {
        // A start that was interrupted leaves the empty table of steps.
        let others = found.tables.iter().filter(|it| *it != APPLIED);
        return match others.min() {
            None => Ok(State::Behind),
            Some(table) => refused(format!(
                "is not empty and not yoto's: it has the table '{table}'; name an empty one"
            )),
        };
    };
    let is_ours = found.tables.iter().any(|it| it == "jobs");
    let foreign = || refused("is another program's; name an empty one".to_owned());
    let altered = |version: i64| {
        refused(format!(
            "has another schema {version} than any version of yoto; restore a copy"
        ))
    };
    if *last < START {
        return match () {
            () if !is_ours => foreign(),
            () if *last < REPLACED => refused(format!(
                "has schema {last}, and this version of yoto takes over schemas from {REPLACED} on: start {BEFORE} with it \
                 once, which brings it to schema {REPLACED}"
            )),
            () if digest(&found.applied) == steps.replaced => Ok(State::Replaced),
            () => altered(*last),
        };
    }
    let newest = steps.newest();
    for (version, checksum) in &found.applied {
        let mut known = std::iter::once(&steps.start).chain(&steps.later);
        match known.find(|it| it.version == *version) {
            Some(step) if *step.checksum == **checksum => {}
            _ if !is_ours => return foreign(),
            None if *version > newest => {
                return refused(format!(
                    "has schema {version}, and this version of yoto knows schemas up to {newest}: use the version \
                     that wrote it, or a newer one"
                ));
            }
            _ => return altered(*version),
        }
    }
    Ok(match *last == newest {
        true => State::Current,
        false => State::Behind,
    })
}

/// Whether a database that this program may use has to be brought up to date.
///
/// # Errors
/// As [`state`].
pub(super) fn are_pending(steps: &Steps, found: &FoundSchema) -> Result<bool, StoreError> {
    Ok(state(steps, found)? != State::Current)
}

/// The refusal to read a database that has to be brought up to date first.
pub(super) fn outdated() -> StoreError {
    StoreError::Unusable(
        "is empty or of an earlier version: start `yoto serve` of this version with it once"
            .to_owned(),
    )
}

/// The steps of a program that is newer by one step, which both databases understand.
#[cfg(test)]
pub(crate) fn with_a_later_step(mut steps: Steps) -> Steps {
    let sql = "ALTER TABLE jobs ADD COLUMN later INTEGER NOT NULL DEFAULT 7";
    steps.later.push(step(steps.newest() + 1, "later", sql));
    steps
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steps() -> Steps {
        let (before, last) = ((31, b"a".to_vec()), (REPLACED, b"b".to_vec()));
        Steps {
            start: step(START, "start", "SELECT 1"),
            later: vec![step(START + 2, "later", "SELECT 2")],
            replaced: digest(&[before, last]),
        }
    }

    /// The answer to a database with these tables and applied steps.
    fn answer(tables: &[&str], applied: &[(i64, &[u8])]) -> String {
        let found = FoundSchema {
            tables: tables.iter().map(|it| (*it).to_owned()).collect(),
            applied: applied
                .iter()
                .map(|(version, sum)| (*version, sum.to_vec()))
                .collect(),
        };
        match state(&steps(), &found) {
            Ok(state) => format!("{state:?}"),
            Err(error) => error.to_string(),
        }
    }

    const OURS: [&str; 2] = [APPLIED, "jobs"];

    #[test]
    fn a_database_is_empty_or_of_this_or_an_earlier_version() {
        let steps = steps();
        let (start, later) = (&*steps.start.checksum, &*steps.later[0].checksum);
        assert_eq!(answer(&[], &[]), "Behind");
        assert_eq!(answer(&[APPLIED], &[]), "Behind");
        assert_eq!(answer(&OURS, &[(39, start)]), "Behind");
        assert_eq!(answer(&OURS, &[(39, start), (41, later)]), "Current");
        let newer = answer(&OURS, &[(39, start), (41, later), (42, b"?")]);
        assert!(
            newer.contains("has schema 42") && newer.contains("up to 41"),
            "{newer}"
        );
        let altered = answer(&OURS, &[(39, b"?")]);
        assert!(altered.contains("another schema 39"), "{altered}");
        let left_out = answer(&OURS, &[(39, start), (40, b"?"), (41, later)]);
        assert!(left_out.contains("another schema 40"), "{left_out}");
    }

    #[test]
    fn the_last_schema_before_the_start_is_taken_over_and_no_earlier_one() {
        assert_eq!(answer(&OURS, &[(31, b"a"), (38, b"b")]), "Replaced");
        for other in [
            &[(31, &b"?"[..]), (38, b"b")][..],
            &[(31, b"a"), (38, b"?")],
            &[(38, b"b")],
        ] {
            let altered = answer(&OURS, other);
            assert!(altered.contains("another schema 38"), "{altered}");
        }
        let early = answer(&OURS, &[(31, b"a")]);
        assert_eq!(
            early,
            "the database has schema 31, and this version of yoto takes over schemas from 38 on: start the program of \
             28 November 2026 (commit 5ce29de0) with it once, which brings it to schema 38"
        );
        let start = &*steps().start.checksum;
        let mixed = answer(&OURS, &[(31, b"a"), (38, b"b"), (39, start)]);
        assert!(mixed.contains("another schema 31"), "{mixed}");
    }

    #[test]
    fn another_program_s_tables_are_left_alone() {
        let tables = answer(&["orders"], &[]);
        assert!(tables.contains("it has the table 'orders'"), "{tables}");
        for version in [7, 38, 2026] {
            let steps = answer(&[APPLIED, "orders"], &[(version, b"?")]);
            assert!(steps.contains("is another program's"), "{steps}");
        }
    }
}
