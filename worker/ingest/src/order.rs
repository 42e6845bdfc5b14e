//! Messages between parent and child: an order in a file, and lines of JSON in reply.

use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use yoto_media::Limits;
use yoto_media::archive::Files;
use yoto_proto::v1::Violation;

/// The task of a child: the data that it reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Task {
    /// The files of a capture.
    Capture,
    /// The picture behind a scene, the only file.
    Backdrop,
}

/// The child's order.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Order {
    /// Its task.
    pub(super) task: Task,
    /// The child's own folder.
    pub(super) folder: PathBuf,
    /// The uploaded files: path in the capture to path on this disk.
    pub(super) files: Files,
    /// Limits of a capture.
    pub(super) limits: Limits,
    /// The program for videos that are not read in-process; searched for if it has no name.
    pub(super) ffmpeg: Option<PathBuf>,
    /// The pose model for a film without poses: a file, or a folder.
    pub(super) pose_model: Option<PathBuf>,
}

impl Order {
    pub(super) fn new(folder: &Path, limits: &Limits) -> Self {
        Self {
            task: Task::Capture,
            folder: folder.to_owned(),
            files: Files::new(),
            limits: limits.clone(),
            ffmpeg: None,
            pose_model: None,
        }
    }

    /// Path of the shard to write.
    pub(super) fn shard(&self) -> PathBuf {
        self.folder.join("shard.bin")
    }

    /// Path of the decoded backdrop to write.
    pub(super) fn backdrop(&self) -> PathBuf {
        self.folder.join("backdrop.rgb")
    }

    /// Path of the check's report to write.
    pub(super) fn check(&self) -> PathBuf {
        self.folder.join("check.json")
    }
}

/// One line of the child's reply.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum ReplyLine {
    /// Its current work, to locate a crash.
    At(Progress),
    /// Its outcome.
    End(Outcome),
}

/// A part of the child's work.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Stage {
    /// Finding the person in a film without poses.
    Poses,
    /// Decoding and packing the frames.
    #[default]
    Decoding,
}

/// The child's current work.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Progress {
    /// The part of its work.
    pub stage: Stage,
    /// File of the capture.
    pub file: String,
    /// Frame of the pose track.
    pub frame: Option<u32>,
    /// Frames done.
    pub done: usize,
    /// Total number of frames; 0 while unknown.
    pub total: usize,
}

/// The child's outcome.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Outcome {
    /// Shard and report are written.
    Done(Prepared),
    /// The upload is at fault.
    Rejected(Vec<JsonViolation>),
    /// This machine is at fault.
    Machine(String),
}

/// The child's results.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Prepared {
    /// A summary of what was read, for people.
    pub(super) notes: Vec<String>,
    /// Warnings of the check, for people.
    pub(super) warnings: Vec<String>,
}

/// A violation, as JSON.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct JsonViolation {
    code: String,
    file: String,
    frame: Option<u32>,
    field: String,
    message: String,
}

impl From<Violation> for JsonViolation {
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

impl From<JsonViolation> for Violation {
    fn from(found: JsonViolation) -> Self {
        Self {
            code: found.code,
            file: found.file,
            frame: found.frame,
            field: found.field,
            message: found.message,
        }
    }
}
