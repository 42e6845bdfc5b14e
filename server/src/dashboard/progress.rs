//! How far a job is.

use super::words::{count, duration, told, whole};
use maud::{Markup, html};
use yoto_proto::v1::{Job, Progress, job};

/// A bar with what the job does; nothing unless it runs.
pub fn bar(job: &Job) -> Markup {
    let Some(progress) = job
        .progress
        .as_ref()
        .filter(|_| job.state() == job::State::Running)
    else {
        return html! {};
    };
    let percent = percent(progress);
    html! {
        div .progress {
            progress max="100" value=(percent) aria-label="progress" { (percent) " %" }
            p .detail { (percent) " % · " (describe(progress)) }
        }
    }
}

/// The completed share, percent.
pub fn percent(progress: &Progress) -> u32 {
    (100.0 * progress.fraction.clamp(0.0, 1.0)).floor() as u32
}

/// Phase, step, speed, loss, held-out quality and time left, as far as they are known.
pub fn describe(progress: &Progress) -> String {
    let mut parts = vec![match progress.phase.as_str() {
        "" => "working".to_owned(),
        phase => told(phase),
    }];
    match (progress.step, progress.total_steps) {
        (0, 0) => {}
        (step, 0) => parts.push(format!("step {}", whole(step))),
        (step, total) => parts.push(format!("step {} of {}", whole(step), whole(total))),
    }
    if progress.steps_per_second > 0.0 {
        parts.push(format!("{:.1} steps/s", progress.steps_per_second));
    }
    if let Some(loss) = progress.loss {
        parts.push(format!("loss {loss:.5}"));
    }
    if let Some(psnr) = progress.psnr {
        parts.push(format!("held-out {psnr:.2} dB"));
    }
    parts.extend(progress.active_parts.iter().map(|it| told(it)));
    if progress.skipped_steps > 0 {
        parts.push(format!("{} skipped", count(progress.skipped_steps, "step")));
    }
    if progress.rollbacks > 0 {
        parts.push(count(progress.rollbacks, "rollback"));
    }
    if let Some(left) = progress.seconds_left.filter(|it| *it > 0.0) {
        parts.push(format!("{} left", duration(left)));
    }
    parts.join(" · ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_known_is_told() {
        let progress = Progress {
            phase: "<b>training".into(),
            step: 12_345,
            fraction: 0.429,
            psnr: Some(24.5),
            seconds_left: Some(61.0),
            ..Progress::default()
        };
        let expected = "<b>training · step 12\u{202f}345 · held-out 24.50 dB · 1:01 left";
        assert_eq!(describe(&progress), expected);
        let job = Job {
            state: job::State::Running.into(),
            progress: Some(progress),
            ..Job::default()
        };
        let shown = bar(&job).into_string();
        assert!(
            shown.contains("value=\"42\"") && shown.contains("&lt;b&gt;training"),
            "{shown}"
        );
        let ended = Job {
            state: job::State::Failed.into(),
            ..job
        };
        assert_eq!(bar(&ended).into_string(), "");
    }
}
