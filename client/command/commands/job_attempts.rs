//! The history of a job: a line per attempt.

use super::job_list::span;
use yoto_proto::v1::{JobAttempt, job_attempt::Outcome};

/// `2 by gpu-3 for 7m: lost`.
pub(super) fn line(attempt: &JobAttempt) -> String {
    let seconds = |at: &Option<prost_types::Timestamp>| Some(at.as_ref()?.seconds as f64);
    let time = seconds(&attempt.begin_time).zip(seconds(&attempt.end_time));
    let time = time.map_or_else(String::new, |(begin, end)| {
        format!(" for {}", span(end - begin))
    });
    let fault = attempt.error.as_ref();
    let fault = fault.map_or_else(String::new, |it| format!(": {} [{}]", it.message, it.code));
    format!(
        "{} by {}{time}: {}{fault}",
        attempt.number,
        attempt.worker_display_name,
        word(attempt.outcome())
    )
}

fn word(outcome: Outcome) -> &'static str {
    match outcome {
        Outcome::Unspecified => "unknown",
        Outcome::Running => "running",
        Outcome::Succeeded => "succeeded",
        Outcome::Failed => "failed",
        Outcome::Cancelled => "cancelled",
        Outcome::Returned => "returned by a worker that shut down",
        Outcome::Postponed => "put back for later",
        Outcome::Lost => "its worker was lost",
        Outcome::Helped => "helped with pictures",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_proto::v1::JobError;

    #[test]
    fn an_attempt_is_one_line() {
        let time = |seconds| Some(prost_types::Timestamp { seconds, nanos: 0 });
        let attempt = JobAttempt {
            number: 2,
            worker_display_name: "gpu-3".into(),
            begin_time: time(1000),
            end_time: time(1420),
            outcome: Outcome::Postponed.into(),
            error: Some(JobError {
                code: "MACHINE".into(),
                message: "the disk is full".into(),
                ..JobError::default()
            }),
            ..JobAttempt::default()
        };
        let expected = "2 by gpu-3 for 7m: put back for later: the disk is full [MACHINE]";
        assert_eq!(line(&attempt), expected);
        let running = JobAttempt {
            number: 1,
            worker_display_name: "embedded".into(),
            outcome: Outcome::Running.into(),
            ..JobAttempt::default()
        };
        assert_eq!(line(&running), "1 by embedded: running");
    }
}
