//! Transactions that are run again when the database has rolled them back for reasons of its own: a deadlock, or a
//! connection that was lost before the commit.

use super::StoreError;
use std::time::Duration;
use yoto_proto::backoff::jitter;

/// Most times that a transaction is run again: after a restart of the database, callers wait no longer than about a second
/// and try again by themselves.
const RETRIES: u32 = 5;
/// Wait before the first of them without jitter. Each later one doubles.
const FIRST_WAIT: Duration = Duration::from_millis(25);

/// How often a transaction was run again.
#[derive(Debug, Default)]
pub(crate) struct Tries(u32);

impl Tries {
    /// Whether to run the transaction again after it failed with `error`; waits before that.
    pub(crate) async fn again(&mut self, error: &StoreError) -> bool {
        let Some(wait) = self.wait(error) else {
            return false;
        };
        tracing::debug!(%error, tries = self.0, "a transaction was rolled back and is run again");
        tokio::time::sleep(wait).await;
        true
    }

    /// Counts a try after `error`; the wait before it, or `None` if the transaction is not run again.
    fn wait(&mut self, error: &StoreError) -> Option<Duration> {
        let rolled_back = matches!(
            error,
            StoreError::Unavailable {
                rolled_back: true,
                ..
            }
        );
        if !rolled_back || self.0 >= RETRIES {
            return None;
        }
        let wait = FIRST_WAIT * (1 << self.0);
        self.0 += 1;
        Some(wait.mul_f64(jitter()))
    }
}

/// Runs `$script`, a future that uses the [`Tx`](super::db::Tx) called `$tx`, and commits what it has written. It is made
/// again for each try, so it clones what it consumes.
macro_rules! transaction {
    ($store:expr, |$tx:ident| $script:expr) => {
        transaction!($store, $store.db.write(), |$tx| $script)
    };
    // As `$begin` begins it.
    ($store:expr, $begin:expr, |$tx:ident| $script:expr) => {{
        let mut tries = $crate::transaction::Tries::default();
        loop {
            let once = async {
                let mut transaction = $begin.await?;
                let answer = {
                    let $tx = &mut transaction;
                    $script.await?
                };
                transaction.commit().await?;
                Ok(answer)
            };
            match once.await {
                Err(error) if tries.again(&error).await => {}
                outcome => break outcome,
            }
        }
    }};
}
pub(super) use transaction;

#[cfg(test)]
mod tests {
    use super::*;

    fn unavailable(rolled_back: bool) -> StoreError {
        StoreError::Unavailable {
            action: "testing",
            cause: "a deadlock".into(),
            rolled_back,
        }
    }

    #[test]
    fn only_what_was_rolled_back_is_run_again_and_not_for_ever() {
        let mut tries = Tries::default();
        assert_eq!(tries.wait(&unavailable(false)), None);
        for _ in 0..RETRIES {
            assert!(tries.wait(&unavailable(true)).is_some());
        }
        assert_eq!(tries.wait(&unavailable(true)), None);
    }
}
