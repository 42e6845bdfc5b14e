//! A capture between reading and writing.

use crate::Pictures;
use yoto_proto::pose_track::PoseTrack;

/// A capture after reading, before writing.
#[derive(Clone, Debug)]
pub struct Imported {
    /// Poses and cameras of each frame; indices are those of the files to write.
    pub track: PoseTrack,
    /// The pictures of each frame, in the track's order.
    pub pictures: Pictures,
    /// Frames that the source has, of which a range selects some.
    pub available: usize,
    /// Assumptions, for people to read.
    pub notes: Vec<String>,
}
