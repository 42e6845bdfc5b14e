//! The progress display of an experiment; the caller provides the terminal.

use yoto_proto::v1::Progress;

/// Display of an experiment.
pub trait Screen {
    /// Shows one permanent line.
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
