//! A capture on this disk. It is read in this process by the code of an ingest job, so that a check before the upload uses
//! the same data as training.

use super::capture::Capture;
use super::edges::{self, Edges};
use super::failure::ReadFailure;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use tempfile::TempDir;
use yoto_capture::FrameImage;
use yoto_media::Limits;
use yoto_media::video::Ffmpeg;
use yoto_proto::pose_track::PoseTrack;

/// The user's own capture. It is trusted, so there are no limits on memory or time.
#[derive(Debug)]
pub struct LocalCapture {
    capture: Capture,
    ffmpeg: Ffmpeg,
    /// Treatment of the masks' edges, once frames were asked for.
    edges: OnceLock<Edges>,
    /// Folder of unpacked archives.
    _folder: TempDir,
}

impl LocalCapture {
    /// Reads everything except the pictures of the capture of `files` (path in it to path on disk). Videos that are not
    /// read in this process are read by the program `ffmpeg`, which is searched for if it has no name.
    ///
    /// # Errors
    /// Faults of the files, and of this machine.
    pub fn open(
        files: &BTreeMap<String, PathBuf>,
        ffmpeg: Option<&Path>,
    ) -> Result<Self, ReadFailure> {
        let folder = tempfile::Builder::new()
            .prefix("yoto-capture-")
            .tempdir()
            .map_err(|error| ReadFailure::Machine(format!("making a folder: {error}")))?;
        Ok(Self {
            capture: Capture::read(folder.path(), files, &Limits::default())?,
            ffmpeg: Ffmpeg::find(ffmpeg),
            edges: OnceLock::new(),
            _folder: folder,
        })
    }

    /// The selected frames after corrections, by ascending index.
    pub fn track(&self) -> &PoseTrack {
        &self.capture.track
    }

    /// Changes and omissions, for people.
    pub fn notes(&self) -> &[String] {
        &self.capture.notes
    }

    /// Decodes the frames at `positions`, which must be ascending, and calls `each` for each of them. Every call decodes a
    /// video from its beginning.
    ///
    /// # Errors
    /// The fault of the first frame that can't be read.
    pub fn frames(
        &self,
        positions: &[usize],
        mut each: impl FnMut(usize, FrameImage),
    ) -> Result<(), ReadFailure> {
        let Capture { track, masks, .. } = &self.capture;
        let learned = || edges::learned(&self.capture, &self.ffmpeg, &mut |_| {});
        let edges = self.edges.get_or_init(learned).clone();
        let mut reader = (self.capture).reader(positions, edges, &self.ffmpeg, &mut |_| {})?;
        for &position in positions {
            if let (Some(frame), Some(&mask)) = (track.frames.get(position), masks.get(position)) {
                each(position, reader.frame(frame, mask, track.image_size)?);
            }
        }
        Ok(())
    }
}
