//! A lost worker is not the job's fault, so the job goes back to the queue; but a job that crashes
//! one worker after another must end.

use yoto_proto::v1::JobError;

/// The verdict on a job whose worker went silent.
#[derive(Debug, Clone, PartialEq)]
pub enum Verdict {
    /// It goes back to its position in the queue.
    Requeue,
    /// Its cancel was requested, and no worker is left to stop: it is CANCELLED.
    Cancel,
    /// It has lost too many workers.
    Fail(JobError),
}

/// The verdict on a job that has lost `losses` workers since its last published checkpoint, the last one being
/// `worker`. The job FAILS at `cap` losses. A job that makes progress never ends this way.
pub fn verdict(losses: u32, cap: u32, cancel_requested: bool, worker: &str) -> Verdict {
    if cancel_requested {
        return Verdict::Cancel;
    }
    if losses < cap {
        return Verdict::Requeue;
    }
    let message = format!(
        "{losses} workers went silent while they ran this job, without a checkpoint in between, the \
         last {worker}"
    );
    Verdict::Fail(JobError {
        code: "WORKERS_LOST".into(),
        message,
        violations: Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_job_that_keeps_losing_workers_fails() {
        assert_eq!(verdict(4, 5, false, "workers/a"), Verdict::Requeue);
        assert_eq!(verdict(9, 5, true, "workers/a"), Verdict::Cancel);
        let Verdict::Fail(error) = verdict(5, 5, false, "workers/a") else {
            panic!("the fifth is too many");
        };
        assert_eq!(error.code, "WORKERS_LOST");
        assert!(error.message.contains("workers/a"), "{}", error.message);
    }
}
