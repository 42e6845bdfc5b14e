//! Waits for conditions, and expected refusals.

use std::future::Future;
use std::time::Duration;
use tokio::time::Instant;
use tonic::{Code, Status};
use tonic_types::StatusExt;

/// Longest wait for a condition.
const DEADLINE: Duration = Duration::from_secs(20);

/// Polls until `probe` finds something, and fails at the deadline.
pub(crate) async fn eventually<T, F: Future<Output = Option<T>>>(
    what: &str,
    mut probe: impl FnMut() -> F,
) -> T {
    let deadline = Instant::now() + DEADLINE;
    loop {
        if let Some(found) = probe().await {
            return found;
        }
        assert!(Instant::now() < deadline, "{what} never came");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

/// The error has `code` and an `ErrorInfo` with `reason`.
pub(crate) fn assert_refused<T: std::fmt::Debug>(
    answer: Result<T, Status>,
    code: Code,
    reason: &str,
) {
    let status = answer.expect_err("is refused");
    assert_eq!(status.code(), code, "{status}");
    let details = status.get_error_details();
    let info = details.error_info().expect("has an ErrorInfo");
    assert_eq!(
        (info.reason.as_str(), info.domain.as_str()),
        (reason, "yoto.v1"),
        "{status}"
    );
}

/// The error is INVALID_ARGUMENT and names `field`.
pub(crate) fn assert_invalid<T: std::fmt::Debug>(answer: Result<T, Status>, field: &str) {
    let status = answer.expect_err("is refused");
    assert_eq!(status.code(), Code::InvalidArgument, "{status}");
    let details = status.get_error_details();
    let bad = details.bad_request().expect("has a BadRequest");
    let fields: Vec<_> = bad
        .field_violations
        .iter()
        .map(|found| found.field.as_str())
        .collect();
    assert_eq!(fields, [field], "{status}");
}
