//! Where an experiment shows its progress; the terminal is the caller's.

use yoto_proto::v1::Progress;

/// What an experiment is watched on.
pub trait Screen {
    /// Shows one line, to stay.
    fn note(&self, line: &str);

    /// Begins an activity called `label`.
    fn begin(&self, label: &str) -> Box<dyn Display>;
}

/// The display of one activity.
pub trait Display {
    /// Shows the current progress.
    fn progress(&mut self, progress: &Progress);

    /// Ends the activity with one line about its outcome.
    fn finish(self: Box<Self>, outcome: &str);
}
