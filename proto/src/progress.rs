//! How far a job is, in words: terminals and pages say the same.

use crate::text::{LINE_CHARACTERS, one_line};
use crate::v1::Progress;

/// One line: phase, step, speed, loss, held-out quality, active parts, steps that were lost, time left. Unknown parts are
/// left out.
pub fn describe(progress: &Progress) -> String {
    let told = |text: &str| one_line(text, LINE_CHARACTERS);
    let count = |number: u64, one: &str, many: &str| match number {
        1 => format!("1 {one}"),
        _ => format!("{number} {many}"),
    };
    let mut parts = vec![match progress.phase.as_str() {
        "" => "working".to_owned(),
        phase => told(phase),
    }];
    match (progress.step, progress.total_steps) {
        (0, 0) => {}
        (step, 0) => parts.push(format!("step {step}")),
        (step, total) => parts.push(format!("step {step}/{total}")),
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
        parts.push(count(
            progress.skipped_steps,
            "step skipped",
            "steps skipped",
        ));
    }
    if progress.rollbacks > 0 {
        parts.push(count(progress.rollbacks, "rollback", "rollbacks"));
    }
    if let Some(left) = progress.seconds_left.filter(|it| *it > 0.0) {
        parts.push(format!("{} left", duration(left)));
    }
    parts.join(" · ")
}

/// `0:07`, `12:34`, `1:02:03`.
pub fn duration(seconds: f64) -> String {
    let seconds = seconds.max(0.0).round() as u64;
    let (hours, minutes, seconds) = (seconds / 3600, seconds / 60 % 60, seconds % 60);
    match hours {
        0 => format!("{minutes}:{seconds:02}"),
        _ => format!("{hours}:{minutes:02}:{seconds:02}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_carries_what_is_known_and_nothing_else() {
        let mut progress = Progress {
            phase: "training".into(),
            step: 120,
            ..Progress::default()
        };
        assert_eq!(describe(&progress), "training · step 120");
        progress.active_parts = vec!["a\u{1b}c\nb".into()];
        assert_eq!(describe(&progress), "training · step 120 · a\\u{1b}c b");
        progress.active_parts.clear();
        progress.total_steps = 400;
        progress.steps_per_second = 9.31;
        progress.loss = Some(0.0123);
        progress.psnr = Some(24.118);
        progress.seconds_left = Some(83.2);
        assert_eq!(
            describe(&progress),
            "training · step 120/400 · 9.3 steps/s · loss 0.01230 · held-out 24.12 dB · 1:23 left"
        );
        let unlucky = Progress {
            skipped_steps: 1,
            rollbacks: 2,
            ..Progress::default()
        };
        assert_eq!(describe(&unlucky), "working · 1 step skipped · 2 rollbacks");
    }

    #[test]
    fn durations_read_like_a_clock() {
        assert_eq!(duration(6.6), "0:07");
        assert_eq!(duration(754.0), "12:34");
        assert_eq!(duration(3723.0), "1:02:03");
        assert_eq!(duration(-1.0), "0:00");
    }
}
