//! What an import reports while it works. This crate shows nothing itself: a command draws a bar, a service tells its client.

use std::fmt;
use std::sync::Arc;

/// A stage of an import or a check that takes long enough to be shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// The pose model searches the frames of a clip for people.
    People,
    /// A matting model makes the masks of a clip.
    Masks,
    /// A body is fitted to the key points of all frames.
    Poses,
    /// All frames are decoded to choose the best.
    BestFrames,
    /// Frames are written.
    Write,
    /// Frames of a capture are checked.
    Check,
}

impl Stage {
    /// A heading of one or two words.
    pub fn label(self) -> &'static str {
        match self {
            Self::People => "people",
            Self::Masks => "masks",
            Self::Poses => "poses",
            Self::BestFrames => "best frames",
            Self::Write => "import",
            Self::Check => "check",
        }
    }

    /// What is counted: "frame" or "step".
    pub fn unit(self) -> &'static str {
        match self {
            Self::Poses => "step",
            _ => "frame",
        }
    }
}

/// A step of an import's progress. Stages follow each other, one at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProgressEvent<'a> {
    /// A stage begins.
    Started(Stage),
    /// `done` of `total` units of a stage are done.
    Counted {
        /// The stage.
        stage: Stage,
        /// Finished units.
        done: usize,
        /// All units.
        total: usize,
    },
    /// Frames are written.
    Written {
        /// Frames so far.
        done: usize,
        /// All frames.
        total: usize,
        /// Bytes so far.
        bytes: u64,
    },
    /// A stage has ended or failed.
    Finished {
        /// The stage.
        stage: Stage,
        /// One line about the outcome, if there is something to say.
        outcome: Option<&'a str>,
    },
    /// A line for people who want details.
    Detail(&'a str),
}

type Receiver = dyn Fn(ProgressEvent<'_>) + Send + Sync;

/// Receives the progress of an import; nobody by default.
#[derive(Clone, Default)]
pub struct Progress(Option<Arc<Receiver>>);

impl Progress {
    /// Calls `receive` with each event.
    pub fn to(receive: impl Fn(ProgressEvent<'_>) + Send + Sync + 'static) -> Self {
        Self(Some(Arc::new(receive)))
    }

    fn report(&self, event: ProgressEvent<'_>) {
        if let Some(receive) = &self.0 {
            receive(event);
        }
    }

    /// Reports a line for people who want details.
    pub(crate) fn detail(&self, text: &str) {
        self.report(ProgressEvent::Detail(text));
    }

    /// Begins a stage, which ends with the returned value.
    pub(crate) fn start(&self, stage: Stage) -> Running<'_> {
        self.report(ProgressEvent::Started(stage));
        Running {
            progress: self,
            stage,
            outcome: None,
        }
    }
}

impl fmt::Debug for Progress {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self.0 {
            Some(_) => "Progress(received)",
            None => "Progress(ignored)",
        })
    }
}

/// A stage that runs. Dropping it reports the end, also where an error leaves the stage.
pub(crate) struct Running<'a> {
    progress: &'a Progress,
    stage: Stage,
    outcome: Option<String>,
}

impl Running<'_> {
    /// Reports that `done` of `total` units are done.
    pub(crate) fn count(&self, done: usize, total: usize) {
        let stage = self.stage;
        self.progress
            .report(ProgressEvent::Counted { stage, done, total });
    }

    /// Reports frames and bytes that are written.
    pub(crate) fn written(&self, done: usize, total: usize, bytes: u64) {
        self.progress
            .report(ProgressEvent::Written { done, total, bytes });
    }

    /// Ends the stage with one line about the outcome.
    pub(crate) fn finish(mut self, outcome: String) {
        self.outcome = Some(outcome);
    }
}

impl Drop for Running<'_> {
    fn drop(&mut self) {
        self.progress.report(ProgressEvent::Finished {
            stage: self.stage,
            outcome: self.outcome.as_deref(),
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    #[test]
    fn every_stage_begins_and_ends_once() {
        let log: Arc<Mutex<Vec<String>>> = Arc::default();
        let kept = log.clone();
        let progress = Progress::to(move |event| {
            kept.lock().expect("a log").push(format!("{event:?}"));
        });
        let people = progress.start(Stage::People);
        people.count(1, 2);
        drop(people);
        progress.start(Stage::Write).finish("2 frames".into());
        let expected = [
            "Started(People)",
            "Counted { stage: People, done: 1, total: 2 }",
            "Finished { stage: People, outcome: None }",
            "Started(Write)",
            "Finished { stage: Write, outcome: Some(\"2 frames\") }",
        ];
        assert_eq!(*log.lock().expect("a log"), expected);
    }
}
