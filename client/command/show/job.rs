//! Jobs, their attempts and their results, in one line each.

use super::{size_of, span};
use yoto_proto::pose_track;
use yoto_proto::v1::job_attempt::Outcome;
use yoto_proto::v1::{EvaluateResult, ExportResult, Job, JobAttempt, TrainResult, job, job_result};
use yoto_terminal::output::others;
use yoto_terminal::progress::{count, describe, duration};

/// Result of a successful job, in one line.
pub(crate) fn job_outcome(job: &Job) -> String {
    match job.result.as_ref().and_then(|result| result.kind.as_ref()) {
        Some(job_result::Kind::Ingest(it)) => {
            format!("{} frames of {}x{}", it.frames, it.width, it.height)
        }
        Some(job_result::Kind::Train(it)) => train_summary(it),
        Some(job_result::Kind::Render(it)) => {
            format!(
                "{} files, {:.2} s per frame on {}",
                it.files.len(),
                it.seconds_per_frame,
                others(&it.device)
            )
        }
        Some(job_result::Kind::Evaluate(it)) => evaluate_summary(it),
        Some(job_result::Kind::Export(it)) => export_summary(it),
        None => job.state().as_str_name().to_owned(),
    }
}

/// Details of a job in its state: of several faults the first.
pub(crate) fn job_detail(job: &Job) -> String {
    match job.state() {
        job::State::Running => job.progress.as_ref().map(describe).unwrap_or_default(),
        job::State::Queued => match &job.waiting {
            Some(cause) => format!("waits to be tried again: {}", others(&cause.message)),
            None => format!("{} ahead in the queue", job.queue_position),
        },
        job::State::Succeeded => job_outcome(job),
        // A cancelled job has an error where nobody asked for its end: a consent was revoked.
        job::State::Failed | job::State::Cancelled => {
            job.error
                .as_ref()
                .map_or_else(String::new, |error| match error.violations.as_slice() {
                    [] => others(&error.message),
                    [one] => pose_track::describe(one),
                    [first, more @ ..] => {
                        format!("{}, and {} more", pose_track::describe(first), more.len())
                    }
                })
        }
        job::State::Unspecified => String::new(),
    }
}

/// `24.12 dB in the box, 32.80 dB whole, on 6 held-out frames of 128 pixels; 2341 steps in 5:00 on
/// cpu…, 1.2 M parameters, checkpoint … (9.3 MB)`.
pub(crate) fn train_summary(result: &TrainResult) -> String {
    let size = size_of(result.image_size);
    let quality = match (result.psnr_mask_box, result.psnr) {
        (Some(inside), Some(whole)) => format!(
            "{inside:.2} dB in the box, {whole:.2} dB whole, on {} held-out frames of {size}; ",
            result.held_out
        ),
        (None, Some(whole)) => {
            format!(
                "{whole:.2} dB on {} held-out frames of {size}; ",
                result.held_out
            )
        }
        (_, None) => String::new(),
    };
    format!(
        "{quality}{} steps in {} on {}, {:.2} M parameters, {} ({:.1} MB)",
        result.steps,
        duration(result.train_seconds),
        others(&result.device),
        result.parameters as f64 / 1e6,
        result.checkpoint,
        result.checkpoint_bytes as f64 / 1e6
    )
}

/// `24.02 dB in the box, 27.13 dB whole, SSIM 0.9312 on 12 held-out pictures of 2 people, 128 pixels`.
pub(crate) fn evaluate_summary(result: &EvaluateResult) -> String {
    let mean = result.mean.unwrap_or_default();
    format!(
        "{:.2} dB in the box, {:.2} dB whole, SSIM {:.4} on {} {} pictures of {} people, {}",
        mean.psnr_mask_box,
        mean.psnr,
        mean.ssim,
        mean.pictures,
        result.protocol,
        result.subjects.len(),
        size_of(result.image_size)
    )
}

/// What an export has made, in one line.
pub(crate) fn export_summary(result: &ExportResult) -> String {
    let files: Vec<&str> = result.files.iter().map(|it| it.file.as_str()).collect();
    format!("{}: {}", files.join(", "), export_contents(result))
}

/// "12 splats", or a mesh with its texture.
pub(crate) fn export_contents(result: &ExportResult) -> String {
    match result.triangles {
        0 => count(result.splats as usize, "splat"),
        triangles => {
            let side = result.texture;
            let triangles = count(triangles as usize, "triangle");
            format!("{triangles}, texture {side} x {side}")
        }
    }
}

/// `2 by gpu-3 for 7m: lost`.
pub(crate) fn attempt_line(attempt: &JobAttempt) -> String {
    let seconds = |at: &Option<prost_types::Timestamp>| Some(at.as_ref()?.seconds as f64);
    let time = seconds(&attempt.begin_time).zip(seconds(&attempt.end_time));
    let time = time.map_or_else(String::new, |(begin, end)| {
        format!(" for {}", span(end - begin))
    });
    let fault = attempt.error.as_ref();
    let fault = fault.map_or_else(String::new, |it| {
        format!(": {} [{}]", others(&it.message), others(&it.code))
    });
    format!(
        "{} by {}{time}: {}{fault}",
        attempt.number,
        others(&attempt.worker_display_name),
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
        Outcome::Returned => "given back by its worker",
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
        assert_eq!(attempt_line(&attempt), expected);
        let running = JobAttempt {
            number: 1,
            worker_display_name: "embedded".into(),
            outcome: Outcome::Running.into(),
            ..JobAttempt::default()
        };
        assert_eq!(attempt_line(&running), "1 by embedded: running");
    }
}
