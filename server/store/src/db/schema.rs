//! Whether a database is one that this program may bring up to date.

use crate::StoreError;
use sqlx::migrate::Migrator;

/// The table with the steps that were applied.
pub const APPLIED: &str = "_sqlx_migrations";

/// What a database contains before it is brought up to date.
#[derive(Debug, Default)]
pub struct Found {
    /// Names of its tables.
    pub tables: Vec<String>,
    /// Number and checksum of each applied step, by number.
    pub applied: Vec<(i64, Vec<u8>)>,
}

/// Refuses a database of another program, or of a newer version of this one.
///
/// # Errors
/// [`StoreError::Unusable`].
pub fn check(known: &Migrator, found: &Found) -> Result<(), StoreError> {
    let refused = |reason: String| Err(StoreError::Unusable(reason));
    if found.applied.is_empty() {
        // A start that was interrupted leaves the empty table of steps.
        let others = found.tables.iter().filter(|it| *it != APPLIED);
        return match others.min() {
            None => Ok(()),
            Some(table) => refused(format!(
                "is not empty and not yoto's: it has the table '{table}'; name an empty one"
            )),
        };
    }
    let newest = known.iter().map(|it| it.version).max().unwrap_or_default();
    for (version, checksum) in &found.applied {
        let step = known.iter().find(|it| it.version == *version);
        match step {
            Some(step) if *step.checksum == **checksum => {}
            _ if !found.tables.iter().any(|it| it == "jobs") => {
                return refused("is another program's; name an empty one".to_owned());
            }
            None if *version > newest => {
                return refused(format!(
                    "has schema {version}, and this version of yoto knows schemas up to {newest}: use the version \
                     that wrote it, or a newer one"
                ));
            }
            _ => {
                return refused(format!(
                    "has another schema {version} than any version of yoto; restore a copy"
                ));
            }
        }
    }
    Ok(())
}

/// Whether a database that this program may use has to be brought up to date.
///
/// # Errors
/// As [`check`].
pub fn are_pending(known: &Migrator, found: &Found) -> Result<bool, StoreError> {
    check(known, found)?;
    let newest = known.iter().map(|it| it.version).max();
    Ok(found.applied.last().map(|(version, _)| *version) != newest)
}

/// The refusal to read a database that has to be brought up to date first.
pub fn outdated() -> StoreError {
    StoreError::Unusable(
        "is empty or of an earlier version: start `yoto serve` of this version with it once"
            .to_owned(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use sqlx::SqlSafeStr;
    use sqlx::migrate::{Migration, MigrationType};

    fn known() -> Migrator {
        let step = |version| {
            let sql = "SELECT 1".into_sql_str();
            Migration::new(version, "step".into(), MigrationType::Simple, sql, false)
        };
        Migrator::with_migrations(vec![step(1), step(3)])
    }

    /// The answer to a database with these tables and applied steps.
    fn answer(tables: &[&str], applied: &[(i64, &[u8])]) -> String {
        let found = Found {
            tables: tables.iter().map(|it| (*it).to_owned()).collect(),
            applied: applied
                .iter()
                .map(|(version, sum)| (*version, sum.to_vec()))
                .collect(),
        };
        match check(&known(), &found) {
            Ok(()) => "usable".to_owned(),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn a_database_is_empty_or_of_this_or_an_earlier_version() {
        let known = known();
        let sum = |version| {
            let step = known.iter().find(|it| it.version == version);
            step.expect("a step").checksum.to_vec()
        };
        let (first, third) = (sum(1), sum(3));
        let ours = [APPLIED, "jobs"];
        assert_eq!(answer(&[], &[]), "usable");
        assert_eq!(answer(&[APPLIED], &[]), "usable");
        assert_eq!(answer(&ours, &[(1, &first)]), "usable");
        assert_eq!(answer(&ours, &[(1, &first), (3, &third)]), "usable");
        let newer = answer(&ours, &[(1, &first), (3, &third), (4, b"?")]);
        assert!(
            newer.contains("has schema 4") && newer.contains("up to 3"),
            "{newer}"
        );
        let altered = answer(&ours, &[(1, b"?")]);
        assert!(altered.contains("another schema 1"), "{altered}");
        let left_out = answer(&ours, &[(1, &first), (2, b"?"), (3, &third)]);
        assert!(left_out.contains("another schema 2"), "{left_out}");
    }

    #[test]
    fn another_program_s_tables_are_left_alone() {
        let tables = answer(&["orders"], &[]);
        assert!(tables.contains("it has the table 'orders'"), "{tables}");
        let steps = answer(&[APPLIED, "orders"], &[(2026, b"?")]);
        assert!(steps.contains("is another program's"), "{steps}");
    }
}
