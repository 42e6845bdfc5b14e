//! The description of a detector's file format, from which all lists of detectors are made.

use super::detections::Detections;
use super::point_set::PointSet;
use crate::ImportError;
use crate::source::{FileData, Part, Source};

/// A file format of detectors.
pub(super) struct DetectorForm {
    /// The detector's name; none for a second form of a detector, and for forms that many programs write.
    pub detector: Option<&'static str>,
    pub fits: RecognisedBy,
    pub read: fn(&DetectorFile<'_>) -> Result<Detections, ImportError>,
}

/// How a file is recognised.
pub(super) enum RecognisedBy {
    /// By the end of its name.
    Ending(&'static str),
    /// By the first line of a `.csv`.
    Table(fn(&Source, &str) -> Result<bool, ImportError>),
    /// By what is in a `.json` or `.npz`.
    Contents(fn(&Part<'_>) -> bool),
}

/// A file of a detector, or one of a folder of them.
pub(super) struct DetectorFile<'a> {
    pub source: &'a Source,
    pub name: &'a str,
    /// The name that the user gave, if it was not a folder's.
    pub given: Option<&'a str>,
    /// The set of the points, if the user says.
    pub points: Option<PointSet>,
    /// Width and height of the clip, pixels.
    pub size: [u32; 2],
}

impl DetectorFile<'_> {
    pub(super) fn data(&self) -> Result<FileData<'_>, ImportError> {
        self.source.data(self.name, None)
    }
}
