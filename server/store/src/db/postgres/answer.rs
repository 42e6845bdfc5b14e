//! How long the database has to answer. Packets that vanish end no connection: the system itself gives up after a quarter of an
//! hour, and a connection on which nothing is sent is never given up.

use sqlx::postgres::PgConnection;
use sqlx::{Connection, Error};
use std::io;
use std::time::Duration;
use tokio::time::timeout;

/// Longest wait for an answer: six times as long as for a lock, and shorter than calls of workers wait in all.
pub(super) const PATIENCE: Duration = Duration::from_secs(60);

/// The result of `work`, or an error of the connection if that is not there in time. The caller drops the connection then.
///
/// # Errors
/// Those of `work`, and [`io::ErrorKind::TimedOut`].
pub(super) async fn within<T>(
    patience: Duration,
    work: impl Future<Output = Result<T, Error>>,
) -> Result<T, Error> {
    timeout(patience, work).await.unwrap_or_else(|_| {
        let waited = format!("no answer for {patience:?}");
        Err(Error::Io(io::Error::new(io::ErrorKind::TimedOut, waited)))
    })
}

/// Makes sure that the database has read all of what was sent, e.g. a ROLLBACK.
///
/// # Errors
/// When the connection is lost.
pub(super) async fn ping(patience: Duration, connection: &mut PgConnection) -> Result<(), Error> {
    within(patience, connection.ping()).await
}
