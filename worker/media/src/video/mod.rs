//! Videos: H.264 in MP4 or MOV in this process, anything else through `ffmpeg`.

mod end;
mod ffmpeg;
mod h264;
mod mp4;
mod sps;
mod yuv;

pub use end::end;
pub use ffmpeg::{Ffmpeg, VARIABLE as FFMPEG_VARIABLE};

use crate::{Fault, Limits, MediaError, Orientation, Picture, sniff};
use ffmpeg::FfmpegVideo;
use h264::{H264, Refusal};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// An open video, read frame by frame in the order shown.
#[derive(Debug)]
pub struct Video {
    by: By,
}

#[derive(Debug)]
enum By {
    H264(Box<H264>),
    Ffmpeg(Box<FfmpegVideo>),
}

impl Video {
    /// Opens the video at `path`. With `need_times`, [`Video::times`] is filled for every
    /// kind of video; `ffmpeg` has to decode the file once more for them.
    ///
    /// # Errors
    /// If the file is not a video, is cut short, or declares too much, or if it needs `ffmpeg`, which is
    /// not found.
    pub fn open(
        path: &Path,
        limits: &Limits,
        ffmpeg: &Ffmpeg,
        need_times: bool,
    ) -> Result<Self, MediaError> {
        let what = match sniffed(path)? {
            sniff::Kind::Mp4 => {
                let track = mp4::open(path, limits)?;
                if let mp4::Codec::Other(name) = &track.codec {
                    format!("'{name}' video in MP4")
                } else {
                    match H264::open(path, track, limits)? {
                        Ok(stream) => {
                            let by = By::H264(Box::new(stream));
                            return Ok(Self { by });
                        }
                        Err(Refusal::Bad(fault)) => return Err(fault.into()),
                        Err(Refusal::Unsupported(what)) => what,
                    }
                }
            }
            kind @ (sniff::Kind::Matroska | sniff::Kind::Avi | sniff::Kind::Mpeg) => {
                kind.name().to_owned()
            }
            other => {
                let message = format!("is {}, not a video", other.name());
                return Err(Fault::undecodable(message).into());
            }
        };
        let stream = ffmpeg.open(path, &what, limits, need_times)?;
        Ok(Self {
            by: By::Ffmpeg(Box::new(stream)),
        })
    }

    /// Number of frames, if the file has it in its headers.
    pub fn frames(&self) -> Option<usize> {
        match &self.by {
            By::H264(stream) => Some(stream.track().times.len()),
            By::Ffmpeg(stream) => (!stream.times.is_empty()).then_some(stream.times.len()),
        }
    }

    /// Time of each frame, ascending, seconds from the first.
    pub fn times(&self) -> &[f64] {
        match &self.by {
            By::H264(stream) => &stream.track().times,
            By::Ffmpeg(stream) => &stream.times,
        }
    }

    /// Description for people: codec, stored size, frames, rotation.
    pub fn describe(&self) -> String {
        match &self.by {
            By::H264(stream) => {
                let (width, height) = stream.size;
                let turned = match stream.track().orientation {
                    Orientation::AsStored => "",
                    Orientation::Clockwise => ", turned right",
                    Orientation::Half => ", turned half round",
                    Orientation::CounterClockwise => ", turned left",
                };
                let frames = stream.track().times.len();
                format!("H.264, {width}x{height}, {frames} frames{turned}")
            }
            By::Ffmpeg(stream) => format!("{}, decoded by ffmpeg", stream.what),
        }
    }

    /// The next frame shown, rotated by the file's display matrix; `None` after the last. With `skip`
    /// the frame is decoded, since later frames depend on it, but not converted and not returned.
    ///
    /// # Errors
    /// If a frame can't be decoded, with its number.
    pub fn next(&mut self, skip: bool) -> Result<Option<Picture>, MediaError> {
        match &mut self.by {
            By::H264(stream) => stream.next(skip),
            By::Ffmpeg(stream) => stream.next(skip),
        }
    }
}

/// The kind of the file at `path`, by its first bytes.
fn sniffed(path: &Path) -> Result<sniff::Kind, MediaError> {
    let mut start = Vec::new();
    File::open(path)
        .and_then(|file| file.take(sniff::PREFIX as u64).read_to_end(&mut start))
        .map_err(MediaError::io(path))?;
    if start.is_empty() {
        return Err(Fault::new("EMPTY", "the file has no bytes").into());
    }
    Ok(sniff::kind(&start))
}
