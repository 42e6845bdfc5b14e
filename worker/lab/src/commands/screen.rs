//! The terminal as the display of an experiment.

use crate::display::{Display, Screen};
use yoto_proto::v1::Progress;
use yoto_terminal::progress::ProgressDisplay;

/// Lines and bars on stderr.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Terminal;

impl Screen for Terminal {
    fn note(&self, line: &str) {
        tell!("{line}");
    }

    fn begin(&self, label: &str) -> Box<dyn Display> {
        Box::new(Shown(ProgressDisplay::new(label)))
    }
}

/// The progress of one experiment.
struct Shown(ProgressDisplay);

impl Display for Shown {
    fn progress(&mut self, progress: &Progress) {
        self.0.progress(progress);
    }

    fn finish(self: Box<Self>, outcome: &str) {
        self.0.finish(outcome);
    }
}
