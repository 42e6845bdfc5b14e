//! The description of a form in which detectors write key points: all lists of detectors are made of these.

use super::detections::Detections;
use super::point_set::PointSet;
use crate::ImportError;
use crate::source::{Data, Part, Source};

/// A form in which detectors write key points.
pub(super) struct Form {
    /// The detector's name; none for a second form of a detector, and for forms that many programs write.
    pub detector: Option<&'static str>,
    pub fits: Fits,
    pub read: fn(&DetectorFile<'_>) -> Result<Detections, ImportError>,
}

/// How a file is recognised.
pub(super) enum Fits {
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
    pub fn data(&self) -> Result<Data<'_>, ImportError> {
        self.source.data(self.name, None)
    }
}
