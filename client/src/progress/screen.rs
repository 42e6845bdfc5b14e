//! The terminal as the display of an experiment.

use super::ProgressDisplay;
use yoto_lab::display::{Display, Screen};
use yoto_proto::v1::Progress;

/// Lines and bars on stderr.
#[derive(Debug, Clone, Copy, Default)]
pub struct Terminal;

impl Screen for Terminal {
    fn note(&self, line: &str) {
        tell!("{line}");
    }

    fn begin(&self, label: &str) -> Box<dyn Display> {
        Box::new(ProgressDisplay::new(label))
    }
}

impl Display for ProgressDisplay {
    fn progress(&mut self, progress: &Progress) {
        Self::progress(self, progress);
    }

    fn finish(self: Box<Self>, outcome: &str) {
        Self::finish(*self, outcome);
    }
}
