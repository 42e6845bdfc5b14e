//! Requests and answers of the reads for pages.

use crate::JobFilter;
use yoto_proto::v1::{Capture, ObjectRef, RenderedFile, Subject};

/// A list of newest jobs among several.
#[derive(Debug, Clone, Default)]
pub struct JobGroup {
    /// Which jobs.
    pub filter: JobFilter,
    /// Ids of jobs, if only some are asked for.
    pub ids: Option<Vec<String>>,
    /// Most jobs.
    pub most: u32,
    /// Whether with their orders, which may be long.
    pub full: bool,
    /// Whether with their places in the queue, which the database counts.
    pub positions: bool,
}

/// A person with the capture by which pages show them.
#[derive(Debug, Clone)]
pub struct Person {
    /// The person.
    pub subject: Subject,
    /// Their newest READY capture, or else the newest one.
    pub portrait: Option<CaptureFiles>,
}

/// A capture with the files that its ingest job has made, whose keys no user sees.
#[derive(Debug, Clone)]
pub struct CaptureFiles {
    /// The capture.
    pub capture: Capture,
    /// Its files; none unless it is READY.
    pub files: Vec<RenderedFile>,
}

impl CaptureFiles {
    /// The object of a file.
    pub fn object(&self, file: &str) -> Option<&ObjectRef> {
        let found = self.files.iter().find(|it| it.file == file);
        found.and_then(|it| it.object.as_ref())
    }
}

/// A model as the page of a person names it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Membership {
    /// `models/{id}`.
    pub model: String,
    /// The name of the model for people.
    pub display_name: String,
    /// Whether its newest checkpoint knows the person; none if the person is not in the model.
    pub trained: Option<bool>,
}
