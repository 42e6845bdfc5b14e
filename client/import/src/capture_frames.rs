//! The frames of a capture in other forms than folders of PNG: a video, an archive, JPEG, an alpha
//! channel. They are decoded one at a time by the code that a check and an ingest job use.

use crate::ImportError;
use crate::capture_dir::{CaptureOptions, DecodedCapture};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use yoto_capture::FrameImage;
use yoto_ingest::{LocalCapture, ReadFailure};
use yoto_proto::pose_track::PoseTrack;

/// Frames of a capture on this disk.
#[derive(Clone, Debug)]
pub struct CaptureFrames {
    path: PathBuf,
    capture: Arc<LocalCapture>,
    /// Indices in the capture's track, in ascending order.
    pub(crate) positions: Vec<usize>,
}

impl CaptureFrames {
    /// All frames of the capture in `path`; videos of other kinds by the program `ffmpeg`, which is
    /// searched for when it has no name.
    pub(crate) fn open(path: &Path, ffmpeg: Option<&Path>) -> Result<Self, ImportError> {
        let decoded = DecodedCapture::open(path, &CaptureOptions::default(), ffmpeg);
        let capture = decoded.map_err(|error| fault(path, error))?.capture;
        Ok(Self {
            path: path.to_owned(),
            positions: (0..capture.track().frames.len()).collect(),
            capture: Arc::new(capture),
        })
    }

    /// The track of all frames, corrected, without distortion.
    pub(crate) fn track(&self) -> &PoseTrack {
        self.capture.track()
    }

    /// Calls `each` with every frame, without distortion.
    ///
    /// # Errors
    /// The fault of the first frame that can't be read; what `each` returns.
    pub(crate) fn for_each(
        &self,
        mut each: impl FnMut(FrameImage) -> Result<(), ImportError>,
    ) -> Result<(), ImportError> {
        let mut done = Ok(());
        let read = self.capture.frames(&self.positions, |_, frame| {
            if done.is_ok() {
                done = each(frame);
            }
        });
        read.map_err(|error| fault(&self.path, error.into()))?;
        done
    }
}

/// The faults of the capture in `path`, or the fault of this machine.
fn fault(path: &Path, error: anyhow::Error) -> ImportError {
    let error = match error.downcast::<ImportError>() {
        Ok(error) => return error,
        Err(error) => error,
    };
    match error.downcast::<ReadFailure>() {
        Ok(ReadFailure::Rejected(violations)) => ImportError::BadCapture {
            place: path.display().to_string(),
            violations,
        },
        Ok(ReadFailure::Machine(message)) => {
            ImportError::file("reading", path)(std::io::Error::other(message))
        }
        Err(error) => ImportError::file("reading", path)(std::io::Error::other(error)),
    }
}
