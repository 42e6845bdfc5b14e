//! Limits what workers report to lengths and figures that the database and clients can use. Workers are not trusted.

use yoto_proto::limits::{
    VIOLATIONS, WORKER_LINE_BYTES, WORKER_LINES, WORKER_TEXT_BYTES, beginning,
};
use yoto_proto::v1::{JobError, JobResult, Progress, WorkerDevice, job_result};

fn cut(text: &mut String) {
    shorten(text, WORKER_TEXT_BYTES);
}

/// Cuts a text to `bytes` bytes, and removes the zero character, which PostgreSQL can't store.
fn shorten(text: &mut String, bytes: usize) {
    text.retain(|it| it != '\0');
    text.truncate(beginning(text, bytes).len());
}

/// Cuts short texts, such as the name of a device.
fn cut_lines<'a>(lines: impl IntoIterator<Item = &'a mut String>) {
    for line in lines {
        shorten(line, WORKER_LINE_BYTES);
    }
}

/// Cuts a list of lines for people.
fn cut_list(lines: &mut Vec<String>) {
    lines.truncate(WORKER_LINES);
    cut_lines(lines);
}

/// A short text, such as a version.
pub(super) fn line(mut line: String) -> String {
    cut_lines([&mut line]);
    line
}

/// The error of a job.
pub(super) fn error(mut error: JobError) -> JobError {
    cut(&mut error.code);
    cut(&mut error.message);
    error.violations.truncate(VIOLATIONS);
    for violation in &mut error.violations {
        cut_lines([
            &mut violation.code,
            &mut violation.file,
            &mut violation.field,
            &mut violation.message,
        ]);
    }
    error
}

/// The device of a worker.
pub(super) fn device(mut device: WorkerDevice) -> WorkerDevice {
    cut(&mut device.backend);
    cut(&mut device.adapter);
    device
}

/// The progress of a job. Figures that are not finite become 0 or absent.
pub(super) fn progress(mut progress: Progress) -> Progress {
    cut_lines([
        &mut progress.phase,
        &mut progress.objective,
        &mut progress.device,
    ]);
    cut_list(&mut progress.active_parts);
    for figure in [
        &mut progress.fraction,
        &mut progress.steps_per_second,
        &mut progress.live_fraction,
        &mut progress.train_seconds,
    ] {
        if !figure.is_finite() {
            *figure = 0.0;
        }
    }
    for figure in [
        &mut progress.loss,
        &mut progress.psnr,
        &mut progress.ssim,
        &mut progress.seconds_left,
    ] {
        *figure = figure.filter(|it| it.is_finite());
    }
    progress
}

/// The texts for people in a job's result. Names of resources and files are checked elsewhere.
pub(super) fn result(mut result: JobResult) -> JobResult {
    match &mut result.kind {
        Some(job_result::Kind::Ingest(it)) => {
            cut_list(&mut it.warnings);
            cut_list(&mut it.notes);
        }
        Some(job_result::Kind::Train(it)) => {
            cut_lines([&mut it.device, &mut it.objective]);
            cut_list(&mut it.active_parts);
            cut_list(&mut it.notes);
        }
        Some(job_result::Kind::Render(it)) => cut_lines([&mut it.device]),
        Some(job_result::Kind::Evaluate(it)) => {
            cut_lines([&mut it.device, &mut it.protocol]);
            cut_list(&mut it.notes);
        }
        Some(job_result::Kind::Export(it)) => cut_lines([&mut it.device]),
        None => {}
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;
    use prost::Message;
    use yoto_proto::v1::{TrainResult, Violation};

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
        assert_eq!(cut.violations[0].message.len(), WORKER_LINE_BYTES);
        assert_eq!(error(cut.clone()), cut);
    }

    #[test]
    fn long_progress_and_results_are_cut() {
        let many = || vec!["x".repeat(1000); 100_000];
        let told = progress(Progress {
            phase: "y".repeat(1 << 20),
            active_parts: many(),
            seconds_left: Some(f64::NAN),
            steps_per_second: f64::INFINITY,
            psnr: Some(f64::INFINITY),
            loss: Some(0.5),
            ..Progress::default()
        });
        assert!(told.encoded_len() < 64 << 10);
        let figures = (told.seconds_left, told.psnr, told.loss);
        assert_eq!(figures, (None, None, Some(0.5)));
        assert_eq!(told.steps_per_second, 0.0);
        assert_eq!(progress(told.clone()), told);
        let told = result(JobResult {
            kind: Some(job_result::Kind::Train(TrainResult {
                notes: many(),
                active_parts: many(),
                ..TrainResult::default()
            })),
        });
        assert!(told.encoded_len() < 128 << 10);
        assert_eq!(result(told.clone()), told);
    }
}
