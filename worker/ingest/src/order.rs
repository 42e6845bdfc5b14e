//! What parent and child tell each other: an order in a file, lines of JSON back.

use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use yoto_media::{Limits, archive::Files};
use yoto_proto::v1::Violation;

/// What the child is to do.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Order {
    /// The folder that is the child's own.
    pub(super) folder: PathBuf,
    /// The uploaded files: path in the capture to path on this disk.
    pub(super) files: Files,
    /// What a capture may hold.
    pub(super) limits: Limits,
    /// The program for videos that are not read in-process; searched for when it has no name.
    pub(super) ffmpeg: Option<PathBuf>,
}

impl Order {
    pub(super) fn new(folder: &Path, limits: &Limits) -> Self {
        Self {
            folder: folder.to_owned(),
            files: Files::new(),
            limits: limits.clone(),
            ffmpeg: None,
        }
    }

    /// Where the shard is to be written.
    pub(super) fn shard(&self) -> PathBuf {
        self.folder.join("shard.bin")
    }

    /// Where the check's report is to be written.
    pub(super) fn check(&self) -> PathBuf {
        self.folder.join("check.json")
    }
}

/// One line of the child's.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Line {
    /// What it works at, so that a crash can be given a place.
    At(Place),
    /// How it ended.
    End(Outcome),
}

/// What the child works at.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Place {
    /// File of the capture.
    pub file: String,
    /// Frame of the pose track.
    pub frame: Option<u32>,
    /// Frames done.
    pub done: usize,
    /// Frames in all; 0 while nobody knows.
    pub total: usize,
}

/// How the child ended.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Outcome {
    /// Shard and report are written.
    Done(Prepared),
    /// The upload is at fault.
    Rejected(Vec<Found>),
    /// This machine is.
    Machine(String),
}

/// What the child made.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Prepared {
    /// What was read and how, for people.
    pub(super) notes: Vec<String>,
    /// What the check warns of, for people.
    pub(super) warnings: Vec<String>,
}

/// A violation, as JSON.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Found {
    code: String,
    file: String,
    frame: Option<u32>,
    field: String,
    message: String,
}

impl From<Violation> for Found {
    fn from(found: Violation) -> Self {
        Self {
            code: found.code,
            file: found.file,
            frame: found.frame,
            field: found.field,
            message: found.message,
        }
    }
}

impl From<Found> for Violation {
    fn from(found: Found) -> Self {
        Self {
            code: found.code,
            file: found.file,
            frame: found.frame,
            field: found.field,
            message: found.message,
        }
    }
}
