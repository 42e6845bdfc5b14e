//! How far a job is.

use maud::{Markup, html};
use yoto_proto::progress::describe;
use yoto_proto::v1::{Job, Progress, job};

/// A bar with what the job does; nothing unless it runs.
pub(crate) fn bar(job: &Job) -> Markup {
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
pub(crate) fn percent(progress: &Progress) -> u32 {
    (100.0 * progress.fraction.clamp(0.0, 1.0)).floor() as u32
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
        let job = Job {
            state: job::State::Running.into(),
            progress: Some(progress),
            ..Job::default()
        };
        let shown = bar(&job).into_string();
        assert!(
            shown.contains("value=\"42\"")
                && shown.contains("42 % · &lt;b&gt;training · step 12345"),
            "{shown}"
        );
        let ended = Job {
            state: job::State::Failed.into(),
            ..job
        };
        assert_eq!(bar(&ended).into_string(), "");
    }
}
