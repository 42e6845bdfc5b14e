//! A capture's pictures by frame, from files or from a video.

use crate::archive::Files;
use crate::video::{Ffmpeg, Video};
use crate::{Limits, MediaError, MediaFault, Picture, decode_still};
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use yoto_proto::media_plan::{PICTURE_ENDINGS, Pictures, Timing, has_ending, index_in_name};
use yoto_proto::pose_track::violation;
use yoto_proto::v1::Violation;

/// A fault with its location, or a fault of this machine.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    /// The user's file is at fault.
    #[error("{}", yoto_proto::pose_track::describe(.0))]
    Bad(Violation),
    /// This machine is at fault.
    #[error(transparent)]
    Machine(MediaError),
}

impl SourceError {
    /// `error` of the file called `file`, at the pose track's frame, if known.
    pub fn at(error: MediaError, file: &str, frame: Option<u32>) -> Self {
        match error {
            MediaError::Bad(fault) => Self::Bad(fault.at(file, frame)),
            machine @ MediaError::Io { .. } => Self::Machine(machine),
        }
    }
}

/// Pictures, read in the order of their frame indices.
#[derive(Debug)]
pub struct Source {
    limits: Limits,
    of: Of,
}

#[derive(Debug)]
enum Of {
    /// Frame index to the picture's name and path.
    Stills(BTreeMap<u32, (String, PathBuf)>),
    /// A video, with its frame for each pose frame.
    Video(Box<Clip>),
}

#[derive(Debug)]
struct Clip {
    name: String,
    video: Video,
    /// Pose frame to the video's frame, in the order shown.
    frame_of: HashMap<u32, usize>,
    /// The last frame read, which several pose frames may share.
    last: Option<(usize, Picture)>,
    /// Frames read so far.
    read: usize,
}

/// The pose frames to read, and their times.
#[derive(Clone, Copy, Debug)]
pub struct WantedFrames<'a> {
    /// Their indices, ascending.
    pub indices: &'a [u32],
    /// Pose frames per second.
    pub fps: f64,
    /// How pose frames correspond to the frames of a video.
    pub timing: Timing,
    /// Width and height of the pose track's pictures.
    pub size: [u32; 2],
}

impl Source {
    /// Opens the pictures of `wanted`.
    ///
    /// # Errors
    /// The wanted frames without a picture, at most `most` of them; a video that can't be read; two
    /// pictures of one frame.
    pub fn open(
        pictures: &Pictures,
        files: &Files,
        wanted: WantedFrames<'_>,
        limits: &Limits,
        ffmpeg: &Ffmpeg,
        most: usize,
    ) -> Result<Self, Vec<SourceError>> {
        let of = match pictures {
            Pictures::Folder(folder) => Of::Stills(stills(folder, files, wanted.indices, most)?),
            Pictures::Video(name) => {
                let clip = Clip::open(name, files, wanted, limits, ffmpeg, most)?;
                Of::Video(Box::new(clip))
            }
        };
        Ok(Self {
            limits: limits.clone(),
            of,
        })
    }

    /// Description for people: codec, size, frames.
    pub fn describe(&self) -> String {
        match &self.of {
            Of::Stills(stills) => format!("{} pictures", stills.len()),
            Of::Video(clip) => clip.video.describe(),
        }
    }

    /// Notes for people: how pictures differ from their file, and what it lacks.
    pub fn notes(&self) -> &[String] {
        match &self.of {
            Of::Stills(_) => &[],
            Of::Video(clip) => clip.video.notes(),
        }
    }

    /// The file that holds the picture of `frame`.
    pub fn name(&self, frame: u32) -> &str {
        match &self.of {
            Of::Stills(stills) => stills.get(&frame).map_or("", |(name, _)| name),
            Of::Video(clip) => &clip.name,
        }
    }

    /// The picture of a wanted frame; frames must be read in ascending order.
    ///
    /// # Errors
    /// If the picture can't be decoded.
    pub fn picture(&mut self, frame: u32) -> Result<Picture, SourceError> {
        let at = |error, name: &str| SourceError::at(error, name, Some(frame));
        match &mut self.of {
            Of::Stills(stills) => {
                let Some((name, path)) = stills.get(&frame) else {
                    let fault = MediaFault::new("MISSING", "no picture was found for this frame");
                    return Err(at(fault.into(), "frames"));
                };
                read_still(path, &self.limits).map_err(|error| at(error, name))
            }
            Of::Video(clip) => clip.picture(frame).map_err(|error| at(error, &clip.name)),
        }
    }
}

impl Clip {
    fn open(
        name: &str,
        files: &Files,
        wanted: WantedFrames<'_>,
        limits: &Limits,
        ffmpeg: &Ffmpeg,
        most: usize,
    ) -> Result<Self, Vec<SourceError>> {
        let bad = |error: MediaError| vec![SourceError::at(error, name, None)];
        let path = files
            .get(name)
            .ok_or_else(|| bad(MediaFault::new("MISSING", "there is no such file").into()))?;
        let by_time = wanted.timing == Timing::Time;
        let mut video = Video::open(path, limits, ffmpeg, by_time).map_err(bad)?;
        video.keep_pixels_for(wanted.size);
        let mut frame_of = HashMap::new();
        let mut missing = Vec::new();
        for &index in wanted.indices {
            match frame_for(index, &wanted, &video) {
                Ok(frame) => {
                    frame_of.insert(index, frame);
                }
                Err(message) if missing.len() < most => {
                    let fault = violation("MISSING", name, Some(index), "", message);
                    missing.push(SourceError::Bad(fault));
                }
                Err(_) => {}
            }
        }
        if !missing.is_empty() {
            return Err(missing);
        }
        Ok(Self {
            name: name.to_owned(),
            video,
            frame_of,
            last: None,
            read: 0,
        })
    }

    fn picture(&mut self, frame: u32) -> Result<Picture, MediaError> {
        let wanted =
            self.frame_of.get(&frame).copied().ok_or_else(|| {
                MediaFault::new("MISSING", "the video has no frame for this pose")
            })?;
        while self.last.as_ref().is_none_or(|(read, _)| *read < wanted) {
            // Frames in between are decoded, since later ones build on them, but not converted.
            let skip = self.read < wanted;
            match self.video.next(skip)? {
                Some(picture) => self.last = Some((self.read, picture)),
                None if skip => {}
                None => {
                    let message = format!("the video ends after {} frames", self.read);
                    return Err(MediaFault::new("MISSING", message).into());
                }
            }
            self.read += 1;
        }
        match &self.last {
            Some((read, picture)) if *read == wanted => Ok(picture.clone()),
            _ => Err(MediaFault::new("MISSING", "frames were read out of order").into()),
        }
    }
}

/// The video's frame for a pose frame, or the reason why the video lacks it.
fn frame_for(index: u32, wanted: &WantedFrames<'_>, video: &Video) -> Result<usize, String> {
    match wanted.timing {
        Timing::Index => {
            let frame = index as usize;
            match video.frames() {
                Some(frames) if frame >= frames => Err(format!(
                    "the pose track has this frame, but the video has only {frames}, 0 to {}",
                    frames.saturating_sub(1)
                )),
                _ => Ok(frame),
            }
        }
        Timing::Time => {
            let times = video.times();
            let time = f64::from(index) / wanted.fps;
            let after = times.partition_point(|&it| it < time);
            let near = [after.checked_sub(1), Some(after)].into_iter().flatten();
            let nearest = near
                .filter_map(|at| Some((at, (times.get(at)? - time).abs())))
                .min_by(|a, b| a.1.total_cmp(&b.1));
            match nearest {
                // At most half a pose interval, so that no frame serves a pose that is nearer to another.
                // The slack is for rounded times.
                Some((frame, off)) if off <= 0.5 / wanted.fps + 1e-6 => Ok(frame),
                Some((_, off)) => Err(format!(
                    "this pose is at {time:.3} s, but the video's nearest frame is {off:.3} s away"
                )),
                None => Err("the video has no frames".to_owned()),
            }
        }
    }
}

/// Reads and decodes one still.
///
/// # Errors
/// The same errors as [`decode_still`], and when the file is over the limit.
pub fn read_still(path: &Path, limits: &Limits) -> Result<Picture, MediaError> {
    Ok(decode_still(&read_file(path, limits)?, limits)?)
}

/// The bytes of a file within the limit.
///
/// # Errors
/// `TOO_LARGE` for a file over the limit, or if the disk fails.
pub fn read_file(path: &Path, limits: &Limits) -> Result<Vec<u8>, MediaError> {
    let size = std::fs::metadata(path).map_err(MediaError::io(path))?.len();
    if size > limits.file_bytes {
        let message = format!(
            "{size} bytes; such a file has at most {}",
            limits.file_bytes
        );
        return Err(MediaFault::new("TOO_LARGE", message).into());
    }
    std::fs::read(path).map_err(MediaError::io(path))
}

/// The wanted pictures below `folder`, by frame index.
fn stills(
    folder: &str,
    files: &Files,
    wanted: &[u32],
    most: usize,
) -> Result<BTreeMap<u32, (String, PathBuf)>, Vec<SourceError>> {
    let prefix = format!("{folder}/");
    let mut stills: BTreeMap<u32, (String, PathBuf)> = BTreeMap::new();
    let mut faults = Vec::new();
    for (name, path) in files.range(prefix.clone()..) {
        if !name.starts_with(&prefix) {
            break;
        }
        let Some(index) = index_in_name(name).filter(|_| has_ending(name, &PICTURE_ENDINGS)) else {
            continue;
        };
        if wanted.binary_search(&index).is_err() {
            continue;
        }
        if let Some((other, _)) = stills.insert(index, (name.clone(), path.clone())) {
            let message = format!("{other} is a picture of the same frame");
            faults.push(violation("DUPLICATE", name, Some(index), "", message));
        }
    }
    let missing = wanted.iter().filter(|index| !stills.contains_key(index));
    faults.extend(
        missing
            .map(|&index| {
                let name = format!("{prefix}{index:06}.png");
                let message = "the pose track has this frame, but the file was not uploaded";
                violation("MISSING", &name, Some(index), "", message)
            })
            .take(most),
    );
    if faults.is_empty() {
        Ok(stills)
    } else {
        faults.truncate(most);
        Err(faults.into_iter().map(SourceError::Bad).collect())
    }
}
