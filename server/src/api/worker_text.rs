//! Texts of workers, cut to what a database and a reader can use: a worker is not trusted to be brief.

use yoto_proto::limits::{VIOLATIONS, WORKER_TEXT_BYTES, beginning};
use yoto_proto::v1::{JobError, WorkerDevice};

fn cut(text: &mut String) {
    text.truncate(beginning(text, WORKER_TEXT_BYTES).len());
}

/// The error of a job.
pub fn error(mut error: JobError) -> JobError {
    cut(&mut error.code);
    cut(&mut error.message);
    error.violations.truncate(VIOLATIONS);
    for violation in &mut error.violations {
        for text in [
            &mut violation.code,
            &mut violation.file,
            &mut violation.field,
            &mut violation.message,
        ] {
            cut(text);
        }
    }
    error
}

/// The device of a worker.
pub fn device(mut device: WorkerDevice) -> WorkerDevice {
    cut(&mut device.backend);
    cut(&mut device.adapter);
    device
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_proto::v1::Violation;

    #[test]
    fn long_reports_are_cut_and_short_ones_are_not_changed() {
        let long = || "ö".repeat(WORKER_TEXT_BYTES);
        let violation = Violation {
            message: long(),
            ..Violation::default()
        };
        let cut = error(JobError {
            code: "REJECTED".into(),
            message: long(),
            violations: vec![violation; VIOLATIONS + 1],
        });
        assert_eq!(cut.message.len(), WORKER_TEXT_BYTES);
        assert_eq!(cut.violations.len(), VIOLATIONS);
        assert_eq!(cut.violations[0].message.len(), WORKER_TEXT_BYTES);
        assert_eq!(error(cut.clone()), cut);
    }
}
