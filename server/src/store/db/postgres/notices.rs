//! Texts that coordinators of one database send to each other through it, by NOTIFY and LISTEN.

use super::failures::During;
use crate::store::StoreError;
use sqlx::PgPool;
use sqlx::postgres::PgListener;

/// The channel's name. Channels are those of one database.
const CHANNEL: &str = "yoto";

/// Receives texts on a connection of the pool.
pub struct Listener(PgListener);

/// Sends a text to all who listen, the sender too.
pub async fn notify(pool: &PgPool, text: &str) -> Result<(), StoreError> {
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
    pub async fn open(pool: &PgPool) -> Result<Self, StoreError> {
        let action = "listening to other coordinators";
        let mut listener = PgListener::connect_with(pool).await.during(action)?;
        listener.listen(CHANNEL).await.during(action)?;
        Ok(Self(listener))
    }

    /// The next text; `None` if some may be lost, since the connection was, and is open again.
    pub async fn next(&mut self) -> Result<Option<String>, StoreError> {
        let next = self.0.try_recv().await;
        let next = next.during("listening to other coordinators")?;
        Ok(next.map(|it| it.payload().to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::super::connections;
    use super::*;
    use yoto_test_postgres::{Database, is_there};

    async fn pool(database: &Database) -> PgPool {
        let url = database.url().parse().expect("an address");
        let options = connections::options(&url).expect("good");
        connections::pool(options).await.expect("connects")
    }

    #[tokio::test]
    async fn texts_arrive_also_after_the_connection_was_lost() {
        if !is_there() {
            return;
        }
        let database = Database::create().expect("PostgreSQL");
        let (here, there) = (pool(&database).await, pool(&database).await);
        let mut listener = Listener::open(&there).await.expect("listens");
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
}
