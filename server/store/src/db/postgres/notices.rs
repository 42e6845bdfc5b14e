//! Texts that coordinators of one database send to each other through it, by NOTIFY and LISTEN.

use super::answer::within;
use super::connections;
use super::failures::During;
use crate::StoreError;
use sqlx::postgres::PgListener;
use sqlx::{Executor, PgPool};
use std::time::Duration;
use tokio::time::timeout;

/// The channel's name. Channels are those of one database.
const CHANNEL: &str = "yoto";
/// Time without a text after which the connection is tested.
const QUIET: Duration = Duration::from_secs(30);

/// Receives texts on a connection of its own.
pub struct Listener {
    inner: PgListener,
    quiet: Duration,
    patience: Duration,
}

/// Sends a text to all who listen, the sender too.
pub(super) async fn notify(pool: &PgPool, text: &str) -> Result<(), StoreError> {
    // Nothing is lost with it, so no commit has to reach the disk.
    sqlx::query("SELECT set_config('synchronous_commit', 'off', TRUE), pg_notify($1, $2)")
        .bind(CHANNEL)
        .bind(text)
        .execute(pool)
        .await
        .during("telling other coordinators")?;
    Ok(())
}

impl Listener {
    /// Connects to the database of `pool`. An answer may take as long as `patience`.
    pub async fn open(pool: &PgPool, patience: Duration) -> Result<Self, StoreError> {
        Self::open_with(pool, QUIET, patience)
            .await
            .during("listening to other coordinators")
    }

    async fn open_with(
        pool: &PgPool,
        quiet: Duration,
        patience: Duration,
    ) -> Result<Self, sqlx::Error> {
        let own = connections::single(pool).await?;
        let mut inner = PgListener::connect_with(&own).await?;
        within(patience, inner.listen(CHANNEL)).await?;
        Ok(Self {
            inner,
            quiet,
            patience,
        })
    }

    /// The next text; `None` if some may be lost, since the connection was, and is open again.
    pub async fn next(&mut self) -> Result<Option<String>, StoreError> {
        let action = "listening to other coordinators";
        loop {
            if let Ok(next) = timeout(self.quiet, self.inner.try_recv()).await {
                let next = next.during(action)?;
                return Ok(next.map(|it| it.payload().to_owned()));
            }
            // Nothing is sent on it otherwise, so that nobody would notice that it leads nowhere.
            let test = self.inner.execute("SELECT 1");
            within(self.patience, test).await.during(action)?;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::answer::PATIENCE;
    use super::*;
    use yoto_test_postgres::{Database, is_there};

    async fn pool(database: &Database) -> PgPool {
        let url = database.url().parse().expect("an address");
        let options = connections::options(&url).expect("good");
        connections::pool(options, PATIENCE, <_>::default())
            .await
            .expect("connects")
    }

    #[tokio::test]
    async fn texts_arrive_also_after_the_connection_was_lost() {
        if !is_there() {
            return;
        }
        let database = Database::create().expect("PostgreSQL");
        let (here, there) = (pool(&database).await, pool(&database).await);
        let mut listener = Listener::open(&there, PATIENCE).await.expect("listens");
        notify(&here, "one").await.expect("is sent");
        let heard = listener.next().await.expect("hears");
        assert_eq!(heard.as_deref(), Some("one"));
        database.cut();
        let heard = listener.next().await.expect("is there again");
        assert_eq!(heard, None, "some may be lost");
        notify(&here, "two").await.expect("is sent");
        let heard = listener.next().await.expect("hears");
        assert_eq!(heard.as_deref(), Some("two"));
    }

    #[tokio::test]
    async fn a_connection_that_leads_nowhere_is_noticed() {
        let Some(database) = Database::create_durable() else {
            eprintln!("skipped: no PostgreSQL");
            return;
        };
        let pool = pool(&database).await;
        let brief = Duration::from_millis(100);
        let listener = Listener::open_with(&pool, brief, Duration::from_secs(1)).await;
        let mut listener = listener.expect("listens");
        let quiet = timeout(5 * brief, listener.next()).await;
        quiet.expect_err("a test of the connection is no text");
        notify(&pool, "one").await.expect("is sent");
        let heard = listener.next().await.expect("hears");
        assert_eq!(heard.as_deref(), Some("one"));
        database.stop(true);
        let lost = timeout(Duration::from_secs(30), listener.next()).await;
        database.stop(false);
        let lost = lost.expect("it is noticed").expect_err("nobody answers");
        assert!(matches!(lost, StoreError::Unavailable { .. }), "{lost}");
    }
}
