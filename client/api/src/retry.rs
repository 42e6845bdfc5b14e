//! Repeated calls while the service can't be reached: a restarted coordinator or a lost connection does not end a
//! call that can be repeated.

use std::time::{Duration, Instant};
use tonic::{Code, Response, Status};
use yoto_proto::backoff::Backoff;
use yoto_proto::reasons;
use yoto_proto::retry::{FailureCause, failure_cause};
use yoto_proto::v1::ErrorReason;

/// How long the service may be out of reach.
const GIVE_UP_AFTER: Duration = Duration::from_secs(60);
/// How often a read is repeated.
const READS_AGAIN: u32 = 2;
pub(super) const FIRST_PAUSE: Duration = Duration::from_millis(100);
const LONGEST_PAUSE: Duration = Duration::from_secs(5);

/// Retries of one call: the first comes at once, later ones after pauses that double.
#[derive(Debug)]
pub(super) struct Retries {
    /// Failures since the last success, and when the first of them was.
    failures: u32,
    since: Option<Instant>,
    backoff: Backoff,
}

impl Retries {
    pub(super) fn new() -> Self {
        Self {
            failures: 0,
            since: None,
            backoff: Backoff::new(FIRST_PAUSE, LONGEST_PAUSE),
        }
    }

    /// After a success, the next failure is the first one.
    pub(super) fn reset(&mut self) {
        *self = Self::new();
    }

    /// Failures since the last success.
    pub(super) fn failures(&self) -> u32 {
        self.failures
    }

    /// The pause before another attempt after the failure `status`; `None` if another attempt is useless, or
    /// the time is up.
    pub(super) fn pause(&mut self, status: &Status) -> Option<Duration> {
        let since = *self.since.get_or_insert_with(Instant::now);
        if !is_transport(status) || since.elapsed() > GIVE_UP_AFTER {
            return None;
        }
        self.failures = self.failures.saturating_add(1);
        Some(match self.failures {
            1 => Duration::ZERO,
            _ => self.backoff.pause(),
        })
    }

    /// Waits before another attempt after the failure `status`.
    ///
    /// # Errors
    /// `status` itself if another attempt is useless, or the time is up.
    pub(super) async fn wait(&mut self, status: Status) -> Result<(), Status> {
        let Some(pause) = self.pause(&status) else {
            return Err(status);
        };
        tracing::debug!(%status, ?pause, "the service can't be reached; trying again");
        tokio::time::sleep(pause).await;
        Ok(())
    }
}

/// Repeats a call that may be delivered more than once, because it carries a request id or changes nothing the second
/// time.
///
/// # Errors
/// The service's refusal; the last failure once it can't be reached for too long.
pub(super) async fn repeat<T, F>(call: impl FnMut() -> F) -> Result<T, Status>
where
    F: Future<Output = Result<Response<T>, Status>>,
{
    repeat_at_most(u32::MAX, call).await
}

/// Repeats a read when its connection breaks: at once, and a moment later. Then another address of the service has answered,
/// if there is one; nobody has to wait for a service that is gone.
///
/// # Errors
/// The service's refusal, or the last failure.
pub(super) async fn read<T, F>(call: impl FnMut() -> F) -> Result<T, Status>
where
    F: Future<Output = Result<Response<T>, Status>>,
{
    repeat_at_most(READS_AGAIN, call).await
}

async fn repeat_at_most<T, F>(times: u32, mut call: impl FnMut() -> F) -> Result<T, Status>
where
    F: Future<Output = Result<Response<T>, Status>>,
{
    let mut retries = Retries::new();
    loop {
        match call().await {
            Ok(answer) => return Ok(answer.into_inner()),
            Err(status) if retries.failures() == times => return Err(status),
            Err(status) => retries.wait(status).await?,
        }
    }
}

/// Whether the connection is at fault rather than the request. A user sees at once that the service is full, and decides
/// whether to wait.
fn is_transport(status: &Status) -> bool {
    if let Some(reason) = reasons::of(status) {
        // The service itself has answered.
        return status.code() == Code::Unavailable || reason == ErrorReason::CorruptChunk;
    }
    failure_cause(status.code()) == FailureCause::Connection
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;
    use std::collections::HashMap;
    use tonic_types::{ErrorDetails, StatusExt};

    #[test]
    fn an_answer_of_the_service_is_final_unless_it_says_otherwise() {
        let answer = |code, reason: &str| {
            let details = ErrorDetails::with_error_info(reason, "yoto.v1", HashMap::new());
            is_transport(&Status::with_error_details(code, "", details))
        };
        assert!(is_transport(&Status::internal("h2 protocol error")));
        assert!(answer(Code::Unavailable, "SHUTTING_DOWN"));
        assert!(answer(Code::DataLoss, "CORRUPT_CHUNK"));
        assert!(!answer(Code::Internal, "INTERNAL"));
        assert!(!answer(Code::DataLoss, "OBJECT_ALTERED"));
        assert!(!is_transport(&Status::not_found("")));
    }

    #[tokio::test]
    async fn only_faults_of_the_connection_are_tried_again_and_not_for_ever() {
        let calls = Cell::new(0);
        let call = |code: Code, until| {
            calls.set(0);
            let calls = &calls;
            move || {
                calls.set(calls.get() + 1);
                let good = calls.get() >= until;
                async move {
                    match good {
                        true => Ok(Response::new(7)),
                        false => Err(Status::new(code, "no")),
                    }
                }
            }
        };
        assert_eq!(
            repeat(call(Code::Unavailable, 3)).await.expect("answers"),
            7
        );
        assert_eq!(calls.get(), 3);
        assert_eq!(read(call(Code::Unavailable, 3)).await.expect("answers"), 7);
        let gone = read(call(Code::Unavailable, 9)).await;
        assert_eq!(gone.expect_err("is gone").code(), Code::Unavailable);
        assert_eq!(calls.get(), 3, "nobody waits for it");
        let refused = repeat(call(Code::InvalidArgument, 4)).await;
        assert_eq!(refused.expect_err("is final").code(), Code::InvalidArgument);
        assert_eq!(calls.get(), 1);
        let mut retries = Retries::new();
        assert_eq!(
            retries.pause(&Status::unavailable("")),
            Some(Duration::ZERO)
        );
        let pause = retries
            .pause(&Status::unavailable(""))
            .expect("tries again");
        assert!(pause > Duration::ZERO && pause < 2 * FIRST_PAUSE);
        assert_eq!(retries.failures(), 2);
        retries.since = Instant::now().checked_sub(GIVE_UP_AFTER * 2);
        let last = retries.wait(Status::unavailable("no")).await;
        assert_eq!(last.expect_err("is final").code(), Code::Unavailable);
    }
}
