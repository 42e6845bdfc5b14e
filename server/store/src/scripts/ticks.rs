//! The last time at which the service checked its leases, or its clock: one table with one row for each.

use crate::StoreError;
use crate::db::{Tx, sql};

/// A recorded check.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Ticks {
    /// Leases were checked for expiry.
    Leases,
    /// The clock was compared with the steady one.
    Clock,
}

impl Ticks {
    /// The time of the last check; `None` before the first one.
    pub(crate) async fn last(self, tx: &mut Tx) -> Result<Option<f64>, StoreError> {
        let statement = match self {
            Self::Leases => "SELECT last_tick FROM lease_clock WHERE id = 1",
            Self::Clock => "SELECT last_tick FROM service_clock WHERE id = 1",
        };
        let row = sql(statement)
            .row(tx, "reading the time of the last check")
            .await?;
        row.map_or(Ok(None), |row| row.real("last_tick"))
    }

    /// Waits until no other transaction checks, and keeps others waiting until this one ends.
    pub(crate) async fn lock(self, tx: &mut Tx) -> Result<(), StoreError> {
        // A write of the row is a lock of it on every database.
        let statement = match self {
            Self::Leases => "UPDATE lease_clock SET last_tick = last_tick WHERE id = 1",
            Self::Clock => "UPDATE service_clock SET last_tick = last_tick WHERE id = 1",
        };
        sql(statement).execute(tx, "waiting for a check").await?;
        Ok(())
    }

    /// Records a check.
    pub(crate) async fn record(self, tx: &mut Tx) -> Result<(), StoreError> {
        let statement = match self {
            Self::Leases => {
                "INSERT INTO lease_clock (id, last_tick) VALUES (1, $1)
                 ON CONFLICT (id) DO UPDATE SET last_tick = $1"
            }
            Self::Clock => {
                "INSERT INTO service_clock (id, last_tick) VALUES (1, $1)
                 ON CONFLICT (id) DO UPDATE SET last_tick = $1"
            }
        };
        sql(statement)
            .bind(tx.now())
            .execute(tx, "recording the time of a check")
            .await?;
        Ok(())
    }
}
