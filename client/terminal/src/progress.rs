//! Current progress of a job or an upload: a live bar on a terminal, a plain line every few seconds
//! elsewhere, always on stderr, since stdout is for results.

mod activities;
mod rate;

pub use activities::Activities;

use crate::output::{self, others};
use indicatif::{DecimalBytes, ProgressBar, ProgressDrawTarget, ProgressStyle};
use rate::Rate;
use std::io::IsTerminal;
use std::time::{Duration, Instant};
pub use yoto_proto::progress::{describe, duration};
pub use yoto_proto::text::count;
use yoto_proto::v1::{Job, Progress, job};

/// Interval between plain lines; shorter activities have only their last line.
const LINE_EVERY: Duration = Duration::from_secs(5);
/// Steps of the bar; a job's fraction is a share of them.
const BAR: u64 = 1000;

/// The display of one job, or of another activity with progress.
#[derive(Debug)]
pub struct ProgressDisplay {
    label: String,
    bar: Option<ProgressBar>,
    last_line: Instant,
    rate: Rate,
    pieces: Rate,
    shown: bool,
}

impl ProgressDisplay {
    /// A display headed by `label`; a bar when stderr is a terminal.
    pub fn new(label: impl Into<String>) -> Self {
        let label = label.into();
        let shown = !output::style().no_progress;
        let bar = (shown && std::io::stderr().is_terminal()).then(|| {
            let bar =
                ProgressBar::with_draw_target(Some(BAR), ProgressDrawTarget::stderr_with_hz(10));
            if let Ok(style) =
                ProgressStyle::with_template("{prefix:<14} {bar:24} {percent:>3}% {wide_msg}")
            {
                bar.set_style(style);
            }
            bar.set_prefix(others(&label));
            bar.enable_steady_tick(Duration::from_millis(500));
            bar
        });
        Self {
            label,
            bar,
            last_line: Instant::now(),
            rate: Rate::new(Instant::now()),
            pieces: Rate::new(Instant::now()),
            shown,
        }
    }

    /// Shows a job's current state.
    pub fn job(&mut self, job: &Job) {
        match (job.state(), &job.progress) {
            (job::State::Queued, _) => self.show(0.0, &queued(job)),
            (_, Some(progress)) => self.progress(progress),
            (_, None) => self.show(0.0, "running"),
        }
    }

    /// Shows that a queued job waits for `others`.
    pub fn waits_for(&mut self, job: &Job, others: &str) {
        self.show(0.0, &format!("{}, waits for {others}", queued(job)));
    }

    /// Shows at once that the service can't be reached, which an attempt every few seconds may change.
    pub fn disconnected(&mut self) {
        let text = "connection lost, retrying";
        match &self.bar {
            Some(bar) => bar.set_message(text),
            None if self.shown => tell!("{}: {text}", self.label),
            None => {}
        }
    }

    /// Shows progress.
    pub fn progress(&mut self, progress: &Progress) {
        self.show(progress.fraction, &describe(progress));
    }

    /// Shows bytes sent of all bytes, their rate, and the remaining time.
    pub fn bytes(&mut self, sent: u64, of: u64) {
        self.moved("uploading", sent, of);
    }

    /// Shows bytes received of all bytes, their rate, and the remaining time.
    pub fn received(&mut self, received: u64, of: u64) {
        self.moved("fetching", received, of);
    }

    /// Shows bytes read and compared of all bytes, their rate, and the remaining time.
    pub fn read(&mut self, read: u64, of: u64) {
        self.moved("reading", read, of);
    }

    fn moved(&mut self, doing: &str, sent: u64, of: u64) {
        let fraction = if of == 0 {
            1.0
        } else {
            sent as f64 / of as f64
        };
        self.rate.at(Instant::now(), sent);
        let rate = self.rate.a_second().filter(|rate| *rate > 0.0);
        let left = rate.map(|rate| of.saturating_sub(sent) as f64 / rate);
        let what = format!("{doing} {} of {}", DecimalBytes(sent), DecimalBytes(of));
        self.show(fraction, &with_rate(what, rate, left));
    }

    /// Shows frames written of all frames, their bytes, the rate of bytes, and the remaining time,
    /// which follows from the frames, since the total number of bytes is unknown.
    pub fn frames(&mut self, done: usize, of: usize, bytes: u64) {
        let now = Instant::now();
        self.rate.at(now, bytes);
        self.pieces.at(now, done as u64);
        let frames = self.pieces.a_second().filter(|rate| *rate > 0.0);
        let left = frames.map(|rate| of.saturating_sub(done) as f64 / rate);
        let what = format!("frame {done} of {of} · {}", DecimalBytes(bytes));
        let text = with_rate(what, self.rate.a_second(), left);
        self.show(done as f64 / of.max(1) as f64, &text);
    }

    /// Shows the number of finished pieces among `of`, each a `what`.
    pub fn count(&mut self, what: &str, done: usize, of: usize) {
        let text = format!("{what} {done} of {of}");
        self.show(done as f64 / of.max(1) as f64, &text);
    }

    /// Writes a line above the bar.
    pub fn note(&self, text: &str) {
        let label = &self.label;
        match &self.bar {
            Some(bar) => bar.println(output::kept(format_args!("{label}: {text}"))),
            None => tell!("{label}: {text}"),
        }
    }

    /// Removes the bar.
    pub fn clear(self) {
        self.remove_bar();
    }

    /// Replaces the bar by one line about the outcome.
    pub fn finish(self, outcome: &str) {
        self.remove_bar();
        tell!("{}: {outcome}", self.label);
    }

    /// Replaces the bar by one line about the outcome, which is a detail.
    pub fn finish_in_detail(self, outcome: &str) {
        self.remove_bar();
        detail!("{}: {outcome}", self.label);
    }

    fn remove_bar(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }

    fn show(&mut self, fraction: f64, text: &str) {
        if let Some(bar) = &self.bar {
            bar.set_position((fraction.clamp(0.0, 1.0) * BAR as f64) as u64);
            bar.set_message(text.to_owned());
            return;
        }
        if self.shown && self.last_line.elapsed() >= LINE_EVERY {
            let percent = 100.0 * fraction.clamp(0.0, 1.0);
            output::passing(format_args!("{}: {percent:3.0}% {text}", self.label));
            self.last_line = Instant::now();
        }
    }
}

/// One line about a job in the queue.
fn queued(job: &Job) -> String {
    let position = match job.queue_position {
        0 => "next in the queue".to_owned(),
        ahead => format!("{ahead} ahead in the queue"),
    };
    if let Some(cause) = &job.waiting {
        return format!("waits to be tried again: {}", others(&cause.message));
    }
    match job.lost_workers {
        0 => format!("queued, {position}"),
        lost => {
            let times = count(lost as usize, "time");
            format!("queued, {position} (its worker was lost {times})")
        }
    }
}

/// One line: what is done, bytes per second, seconds left; the last two once they are known.
fn with_rate(mut text: String, rate: Option<f64>, left: Option<f64>) -> String {
    if let Some(rate) = rate {
        text += &format!(" · {}/s", DecimalBytes(rate as u64));
    }
    if let Some(left) = left {
        text += &format!(" · {} left", duration(left));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_upload_tells_bytes_rate_and_time_left() {
        let what = || "uploading 1.00 MB of 4.00 MB".to_owned();
        assert_eq!(with_rate(what(), None, None), what());
        assert_eq!(
            with_rate(what(), Some(500_000.0), Some(6.0)),
            "uploading 1.00 MB of 4.00 MB · 500.00 kB/s · 0:06 left"
        );
    }
}
