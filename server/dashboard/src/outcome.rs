//! How a job has ended: its result or its error.

use super::curves::figure;
use super::findings::violations;
use super::words::{bytes, count, short, told, whole};
use maud::{Markup, html};
use yoto_proto::progress::duration;
use yoto_proto::v1::{EvaluateResult, Job, JobError, JobResult, TrainResult, job, job_result};

/// Why a job failed.
pub(crate) fn error(error: &JobError) -> Markup {
    html! {
        div .message .bad role="alert" {
            p { (told(&error.message)) @if !error.code.is_empty() { " " code { (told(&error.code)) } } }
            (violations(&error.violations))
        }
    }
}

/// The outcome in one line for a list: the result, the first fault, or how far it is.
pub(crate) fn line(job: &Job) -> String {
    match job.state() {
        job::State::Running => job.progress.as_ref().map_or_else(String::new, |it| {
            format!(
                "{} % · {}",
                super::progress::percent(it),
                yoto_proto::progress::describe(it)
            )
        }),
        job::State::Queued => match &job.waiting {
            Some(cause) => format!("waits to be tried again: {}", told(&cause.message)),
            None => format!("{} ahead in the queue", job.queue_position),
        },
        job::State::Failed => job
            .error
            .as_ref()
            .map_or_else(String::new, |it| told(&it.message)),
        job::State::Succeeded => job.result.as_ref().map_or_else(String::new, brief),
        job::State::Cancelled | job::State::Unspecified => String::new(),
    }
}

/// A result in one line.
fn brief(result: &JobResult) -> String {
    match &result.kind {
        Some(job_result::Kind::Ingest(it)) => {
            format!(
                "{} of {} × {}",
                count(it.frames.into(), "frame"),
                it.width,
                it.height
            )
        }
        Some(job_result::Kind::Train(it)) => {
            let quality = it
                .psnr
                .map_or_else(String::new, |psnr| format!("{psnr:.2} dB held-out, "));
            format!(
                "{quality}{} in {}",
                count(it.steps, "step"),
                duration(it.train_seconds)
            )
        }
        Some(job_result::Kind::Render(it)) => {
            format!(
                "{}, {:.2} s per frame",
                count(it.files.len() as u64, "file"),
                it.seconds_per_frame
            )
        }
        Some(job_result::Kind::Evaluate(it)) => {
            let mean = it.mean.unwrap_or_default();
            format!("{:.2} dB, SSIM {:.4}", mean.psnr, mean.ssim)
        }
        Some(job_result::Kind::Export(it)) => {
            let files: Vec<String> = it.files.iter().map(|it| told(&it.file)).collect();
            files.join(", ")
        }
        None => String::new(),
    }
}

/// A result in full.
pub(crate) fn result(result: &JobResult) -> Markup {
    match &result.kind {
        Some(job_result::Kind::Ingest(it)) => html! {
            p { (brief(result)) }
            (notes(it.warnings.iter().chain(&it.notes)))
        },
        Some(job_result::Kind::Train(it)) => train(it),
        Some(job_result::Kind::Render(it)) => html! {
            dl .facts {
                div { dt { "Files" } dd { (it.files.len()) } }
                div { dt { "Seconds per frame" } dd { (figure(Some(it.seconds_per_frame), 3)) } }
                div { dt { "Device" } dd { (told(&it.device)) } }
                div { dt { "Checkpoint" } dd { "step " (short_step(&it.checkpoint)) } }
            }
        },
        Some(job_result::Kind::Evaluate(it)) => evaluate(it),
        Some(job_result::Kind::Export(it)) => html! {
            dl .facts {
                @if it.splats > 0 { div { dt { "Splats" } dd { (whole(it.splats.into())) } } }
                @if it.triangles > 0 { div { dt { "Triangles" } dd { (whole(it.triangles.into())) } } }
                div { dt { "Device" } dd { (told(&it.device)) } }
                div { dt { "Checkpoint" } dd { "step " (short_step(&it.checkpoint)) } }
            }
        },
        None => html! {},
    }
}

/// The step in the name of a checkpoint.
fn short_step(checkpoint: &str) -> String {
    let step = checkpoint.rsplit('/').next().unwrap_or_default();
    step.parse().map_or_else(|_| short(checkpoint), whole)
}

fn train(it: &TrainResult) -> Markup {
    html! {
        dl .facts {
            div { dt { "Held-out PSNR" } dd { (figure(it.psnr, 2)) " dB" } }
            div { dt { "In the box" } dd { (figure(it.psnr_mask_box, 2)) " dB" } }
            div { dt { "Held-out frames" } dd { (it.held_out) } }
            div { dt { "Steps" } dd { (whole(it.steps)) " in " (duration(it.train_seconds)) } }
            div { dt { "Parameters" } dd { (whole(it.parameters)) } }
            div { dt { "Checkpoint" } dd { "step " (short_step(&it.checkpoint)) ", " (bytes(it.checkpoint_bytes)) } }
            div { dt { "Objective" } dd { (told(&it.objective)) } }
            div { dt { "Device" } dd { (told(&it.device)) } }
        }
        (train_notes(it))
    }
}

/// What was noted in a training, and what was active at its end.
pub(crate) fn train_notes(it: &TrainResult) -> Markup {
    notes(it.notes.iter().chain(&it.active_parts))
}

/// Figures of each person.
pub(crate) fn evaluate(it: &EvaluateResult) -> Markup {
    html! {
        div .scroll tabindex="0" role="group" aria-label="Table" { table {
            caption { (told(&it.protocol)) " pictures of the checkpoint at step " (short_step(&it.checkpoint)) ", on " (told(&it.device)) }
            thead { tr { th { "Person" } th { "Pictures" } th { "PSNR, dB" } th { "In the box, dB" } th { "SSIM" } th { "LPIPS" } } }
            tbody {
                @for (who, scores) in it.subjects.iter().map(|it| (told(&it.display_name), it.scores)).chain([("mean".to_owned(), it.mean)]) {
                    @let scores = scores.unwrap_or_default();
                    tr {
                        th scope="row" { bdi { (who) } }
                        td { (scores.pictures) }
                        td { (figure(Some(scores.psnr), 2)) }
                        td { (figure(Some(scores.psnr_mask_box), 2)) }
                        td { (figure(Some(scores.ssim), 4)) }
                        td { (figure(scores.lpips, 4)) }
                    }
                }
            }
        } }
        (notes(it.notes.iter()))
    }
}

fn notes<'a>(lines: impl Iterator<Item = &'a String>) -> Markup {
    let mut lines = lines.peekable();
    html! {
        @if lines.peek().is_some() {
            ul .advice { @for line in lines { li { (told(line)) } } }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_proto::v1::Violation;

    #[test]
    fn a_failure_names_its_places_and_is_no_markup() {
        let shown = error(&JobError {
            code: "REJECTED".into(),
            message: "<script>alert(1)</script>".into(),
            violations: vec![Violation {
                file: "a\u{202e}.png".into(),
                frame: Some(3),
                message: "is no picture".into(),
                ..Violation::default()
            }],
        });
        let shown = shown.into_string();
        assert!(
            shown.contains("&lt;script&gt;") && !shown.contains("<script"),
            "{shown}"
        );
        assert!(
            shown.contains("<code>a\\u{202e}.png</code> frame 3 is no picture"),
            "{shown}"
        );
    }

    #[test]
    fn a_line_tells_the_state() {
        let mut job = Job {
            state: job::State::Queued.into(),
            queue_position: 2,
            ..Job::default()
        };
        assert_eq!(line(&job), "2 ahead in the queue");
        job.state = job::State::Succeeded.into();
        let result = TrainResult {
            steps: 1,
            train_seconds: 61.0,
            psnr: Some(24.0),
            ..TrainResult::default()
        };
        job.result = Some(JobResult {
            kind: Some(job_result::Kind::Train(result)),
        });
        assert_eq!(line(&job), "24.00 dB held-out, 1 step in 1:01");
    }
}
