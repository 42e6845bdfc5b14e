//! Patience with a service that can't be reached: a restarted coordinator or a lost connection is not the
//! end of a call that can be repeated.

use std::time::{Duration, Instant};
use tonic::{Code, Response, Status};
use tonic_types::StatusExt;

/// The service's reason for a chunk that was altered on its way.
const CORRUPT_CHUNK: &str = "CORRUPT_CHUNK";

/// How long the service may be out of reach.
pub(super) const GIVE_UP_AFTER: Duration = Duration::from_secs(60);
pub(super) const FIRST_PAUSE: Duration = Duration::from_millis(100);
pub(super) const LONGEST_PAUSE: Duration = Duration::from_secs(5);

/// Pauses between attempts: the second comes at once, the later ones after pauses that double.
#[derive(Debug)]
pub(super) struct Patience {
    since: Option<Instant>,
    pause: Duration,
}

impl Patience {
    pub(super) fn new() -> Self {
        Self {
            since: None,
            pause: Duration::ZERO,
        }
    }

    /// After a success, the next failure is the first one.
    pub(super) fn renew(&mut self) {
        *self = Self::new();
    }

    /// Waits before another attempt after the failure `status`.
    ///
    /// # Errors
    /// `status` itself if another attempt is of no use, or the time is up.
    pub(super) async fn wait(&mut self, status: Status) -> Result<(), Status> {
        let since = *self.since.get_or_insert_with(Instant::now);
        if !is_transport(&status) || since.elapsed() > GIVE_UP_AFTER {
            return Err(status);
        }
        tracing::debug!(%status, pause = ?self.pause, "the service can't be reached; trying again");
        tokio::time::sleep(self.pause).await;
        self.pause = (self.pause * 2).clamp(FIRST_PAUSE, LONGEST_PAUSE);
        Ok(())
    }
}

/// The answer to a call that may be delivered more than once, since it carries a request id or changes
/// nothing the second time.
///
/// # Errors
/// The service's refusal; the last failure once it can't be reached for too long.
pub(super) async fn repeat<T, F>(mut call: impl FnMut() -> F) -> Result<T, Status>
where
    F: Future<Output = Result<Response<T>, Status>>,
{
    let mut patience = Patience::new();
    loop {
        match call().await {
            Ok(answer) => return Ok(answer.into_inner()),
            Err(status) => patience.wait(status).await?,
        }
    }
}

/// Whether the connection is at fault rather than the request.
pub(super) fn is_transport(status: &Status) -> bool {
    if let Some(info) = status.get_error_details().error_info() {
        // The service itself has answered.
        return status.code() == Code::Unavailable || info.reason == CORRUPT_CHUNK;
    }
    // A broken connection arrives as any of these, depending on how far the answer came; a silent one
    // has exceeded the service's time limit.
    matches!(
        status.code(),
        Code::Unavailable
            | Code::Cancelled
            | Code::Unknown
            | Code::Internal
            | Code::Aborted
            | Code::DeadlineExceeded
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{cell::Cell, collections::HashMap};
    use tonic_types::ErrorDetails;

    #[test]
    fn an_answer_of_the_service_is_final_unless_it_says_otherwise() {
        let answer = |code, reason: &str| {
            let details = ErrorDetails::with_error_info(reason, "yoto.v1", HashMap::new());
            is_transport(&Status::with_error_details(code, "", details))
        };
        assert!(is_transport(&Status::internal("h2 protocol error")));
        assert!(answer(Code::Unavailable, "SHUTTING_DOWN"));
        assert!(answer(Code::DataLoss, CORRUPT_CHUNK));
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
        let refused = repeat(call(Code::InvalidArgument, 4)).await;
        assert_eq!(refused.expect_err("is final").code(), Code::InvalidArgument);
        assert_eq!(calls.get(), 1);
        let mut patience = Patience::new();
        patience.since = Instant::now().checked_sub(GIVE_UP_AFTER * 2);
        let last = patience.wait(Status::unavailable("no")).await;
        assert_eq!(last.expect_err("is final").code(), Code::Unavailable);
    }
}
