//! What was seen, in order: in memory, and as JSON lines on disk.

use super::fault::Fault;
use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// One observation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "kebab-case")]
pub(crate) enum Event {
    /// The service has acknowledged a job.
    Acknowledged {
        /// `jobs/{id}`.
        job: String,
        /// Request id of the call, and owner of the job; empty for the ingest of an upload.
        request: String,
    },
    /// The service has acknowledged an upload.
    Uploaded {
        /// Its capture.
        capture: String,
    },
    /// A client is about to delete something.
    Deleted {
        /// What was deleted.
        name: String,
    },
    /// A client is about to cancel a job.
    Cancelled {
        /// `jobs/{id}`.
        job: String,
    },
    /// The plan makes a job fail.
    Doomed {
        /// `jobs/{id}`.
        job: String,
    },
    /// A job in a state that it did not have when it was last seen.
    Seen {
        /// `jobs/{id}`.
        job: String,
        /// Name of its state.
        state: String,
        /// Number of its newest attempt; 0 before the first.
        attempt: u64,
    },
    /// The plan made a fault happen.
    Broken {
        /// What.
        fault: Fault,
    },
    /// A write under a lease that is not the job's newest.
    Late {
        /// The job.
        job: String,
        /// The call, and what is wrong with its claim.
        what: String,
        /// Whether the coordinator accepted it.
        accepted: bool,
    },
    /// A lost worker's job was leased again, or a lost coordinator answered again.
    Recovered {
        /// What was lost.
        fault: Fault,
        /// Time since its end.
        seconds: f64,
    },
    /// A bit of an object was flipped.
    Flipped {
        /// Key of the object.
        key: String,
        /// The checkpoint that it belongs to.
        checkpoint: String,
    },
    /// A job that could have used a damaged checkpoint has succeeded.
    Served {
        /// The job.
        job: String,
        /// The damaged checkpoint.
        damaged: String,
        /// The checkpoint that it used.
        used: String,
    },
}

/// An append-only record.
#[derive(Debug)]
pub(crate) struct History {
    began: Instant,
    inside: Mutex<(Vec<Event>, File)>,
}

#[derive(Serialize)]
struct Line<'a> {
    seconds: f64,
    #[serde(flatten)]
    event: &'a Event,
}

impl History {
    /// Starts a record in the file at `path`.
    ///
    /// # Errors
    /// When the file can't be created.
    pub(crate) fn create(path: &Path) -> Result<Self> {
        let file = File::create(path).with_context(|| path.display().to_string())?;
        Ok(Self {
            began: Instant::now(),
            inside: Mutex::new((Vec::new(), file)),
        })
    }

    /// Appends an event.
    ///
    /// # Errors
    /// When it can't be written.
    pub(crate) fn record(&self, event: Event) -> Result<()> {
        let line = Line {
            seconds: self.began.elapsed().as_secs_f64(),
            event: &event,
        };
        let mut text = serde_json::to_vec(&line)?;
        text.push(b'\n');
        let mut inside = self.inside.lock().unwrap_or_else(PoisonError::into_inner);
        inside.1.write_all(&text).context("writing the history")?;
        inside.0.push(event);
        Ok(())
    }

    /// All events so far.
    pub(crate) fn events(&self) -> Vec<Event> {
        let inside = self.inside.lock().unwrap_or_else(PoisonError::into_inner);
        inside.0.clone()
    }
}
