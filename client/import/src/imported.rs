//! A capture between reading and writing.

use crate::Pictures;
use image::RgbImage;
use yoto_capture::check::Lack;
use yoto_pose::Fitted;
use yoto_proto::pose_track::PoseTrack;

/// Findings of a reader about a clip, for a short report.
#[derive(Clone, Debug, Default)]
pub struct Findings {
    /// The fit of poses, if this program made it.
    pub fit: Option<PoseFit>,
    /// What the user should look at or decide.
    pub doubts: Vec<String>,
    /// What the clip lacks, as far as the reader can tell.
    pub lacks: Vec<Lack>,
    /// A frame of a clip of several people, with everybody's number.
    pub people: Option<RgbImage>,
}

/// A fit of poses in figures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseFit {
    /// The number of frames that were searched for the person.
    pub searched: usize,
    /// Median reprojection error, pixels.
    pub error_px: f64,
    /// Focal length, pixels.
    pub focal_px: f64,
}

impl PoseFit {
    /// The figures of `fitted`, after a search in `searched` frames.
    pub(crate) fn of(fitted: &Fitted, searched: usize) -> Self {
        Self {
            searched,
            error_px: fitted.reprojection_px,
            focal_px: fitted.focal,
        }
    }
}

/// A capture after reading, before writing.
#[derive(Clone, Debug)]
pub struct Imported {
    /// Poses and cameras of each frame; indices are those of the files to write.
    pub track: PoseTrack,
    /// The pictures of each frame, in the track's order.
    pub pictures: Pictures,
    /// Number of frames of the source, before a range selects some.
    pub available: usize,
    /// Assumptions, for people to read.
    pub notes: Vec<String>,
    /// Findings of the reader, for a short report.
    pub found: Findings,
}
