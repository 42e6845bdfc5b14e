//! Videos: H.264 in MP4 or MOV in this process, anything else through `ffmpeg`.

mod aspect;
mod declared;
mod end;
mod ffmpeg;
mod h264;
mod hdr;
mod light;
mod mp4;
mod ppm;
mod signal;
mod sps;
mod tags;
mod yuv;

pub use end::end;
pub use ffmpeg::{Ffmpeg, VARIABLE as FFMPEG_VARIABLE};
pub use hdr::Hdr;
pub use tags::remove_tags;

use crate::{Limits, MediaError, MediaFault, Orientation, Picture, sniff};
use aspect::Aspect;
use ffmpeg::FfmpegVideo;
use h264::{H264, Refusal};
use light::{Levels, ToneMap};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// An open video, read frame by frame in the order shown.
#[derive(Debug)]
pub struct Video {
    by: By,
    limits: Limits,
    /// Shape of pixels, which are made square.
    aspect: Option<Aspect>,
    /// From the light of HDR to levels of ordinary video.
    tone_map: Option<ToneMap>,
    /// The first frame, once it was looked at.
    first: Option<Raw>,
    notes: Vec<String>,
}

#[derive(Debug)]
enum By {
    H264(Box<H264>),
    Ffmpeg(Box<FfmpegVideo>),
}

/// A frame as decoded, rotated.
#[derive(Debug)]
struct Raw {
    width: usize,
    height: usize,
    levels: Levels,
}

impl Raw {
    /// The pixels after a rotation.
    fn turned(self, orientation: Orientation) -> Self {
        if orientation == Orientation::AsStored {
            return self;
        }
        let (width, height) = orientation.size(self.width, self.height);
        let (w, h) = (self.width, self.height);
        let levels = match &self.levels {
            Levels::Eight(it) => Levels::Eight(orientation.apply(w, h, it)),
            Levels::Sixteen(it) => Levels::Sixteen(orientation.apply(w, h, it)),
        };
        Self {
            width,
            height,
            levels,
        }
    }
}

impl Video {
    /// Opens the video at `path`. With `need_times`, [`Video::times`] is filled for every
    /// kind of video; `ffmpeg` has to decode the file once more for them.
    ///
    /// # Errors
    /// If the file is not a video, is cut short before its first frame's end, or declares too much, or if it needs `ffmpeg`, which
    /// is not found.
    pub fn open(
        path: &Path,
        limits: &Limits,
        ffmpeg: &Ffmpeg,
        need_times: bool,
    ) -> Result<Self, MediaError> {
        Self::open_as(path, limits, ffmpeg, need_times, Hdr::Auto)
    }

    /// Opens a video as [`Self::open`] does, but takes its levels for the light `hdr`.
    ///
    /// # Errors
    /// The same errors as [`Self::open`].
    pub fn open_as(
        path: &Path,
        limits: &Limits,
        ffmpeg: &Ffmpeg,
        need_times: bool,
        hdr: Hdr,
    ) -> Result<Self, MediaError> {
        let mut most = None;
        let mut listed = None;
        let what = match sniffed(path)? {
            sniff::FileType::Mp4 => {
                let track = mp4::open(path, limits)?;
                listed = track.listed;
                most = listed.map(|_| track.times.len());
                if let mp4::Codec::Other(name) = &track.codec {
                    format!("'{name}' video in MP4")
                } else {
                    match H264::open(path, track, limits)? {
                        Ok(stream) => {
                            return Self::new(By::H264(Box::new(stream)), limits, listed, hdr);
                        }
                        Err(Refusal::Bad(fault)) => return Err(fault.into()),
                        Err(Refusal::Unsupported(what)) => what,
                    }
                }
            }
            kind @ (sniff::FileType::Matroska | sniff::FileType::Avi | sniff::FileType::Mpeg) => {
                kind.name().to_owned()
            }
            other => {
                let message = format!("is {}, not a video", other.name());
                return Err(MediaFault::undecodable(message).into());
            }
        };
        let stream = ffmpeg.open(path, &what, limits, need_times, most, hdr)?;
        Self::new(By::Ffmpeg(Box::new(stream)), limits, listed, hdr)
    }

    fn new(by: By, limits: &Limits, listed: Option<usize>, hdr: Hdr) -> Result<Self, MediaError> {
        let (declared, aspect) = match &by {
            By::H264(stream) => {
                let is_turned = stream.track().orientation.size(0, 1) == (1, 0);
                let stored = stream.aspect.and_then(Aspect::of);
                let turned = |it: Aspect| if is_turned { it.turned() } else { it };
                (stream.signal, stored.map(turned))
            }
            By::Ffmpeg(stream) => (
                stream.about.signal,
                stream.about.aspect.and_then(Aspect::of),
            ),
        };
        let signal = hdr.of(declared);
        let mut video = Self {
            by,
            limits: limits.clone(),
            aspect,
            tone_map: None,
            first: None,
            notes: Vec::new(),
        };
        if aspect.is_some() || signal.light().is_some() {
            video.first = video.raw(false)?;
        }
        // The first note: see `keep_pixels_for`.
        if let (Some(aspect), Some(first)) = (aspect, &video.first) {
            let [width, height] = aspect.size([first.width, first.height]);
            video.notes.push(format!(
                "the video's pixels are {aspect}, not square: its pictures of {}x{} are made {width}x{height}",
                first.width, first.height
            ));
        }
        if let Some(light) = signal.light() {
            let map = ToneMap::new(light);
            let is_wrong = |it: &Raw| declared::is_wrong(&map, light, &it.levels, it.width);
            if hdr == Hdr::Auto && video.first.as_ref().is_some_and(is_wrong) {
                video.notes.push(format!(
                    "the video declares {light}, but its colours are those of ordinary video: they are left as they are"
                ));
            } else {
                let is = if signal == declared {
                    "is"
                } else {
                    "is taken for"
                };
                video.notes.push(format!(
                    "the video {is} {light}: it is converted to ordinary video (BT.709; white is 203 cd/m², brighter light is compressed)"
                ));
                video.tone_map = Some(map);
            }
        }
        if let (None, Some(light)) = (signal.light(), declared.light()) {
            video.notes.push(format!(
                "the video declares {light}, and is taken for ordinary video: its levels are left as they are"
            ));
        }
        if let Some(listed) = listed {
            let frames = video.frames().unwrap_or_default();
            video.notes.push(match listed > frames {
                true => format!(
                    "the file is cut short: its first {frames} frames are read, of the {listed} that its headers list"
                ),
                false => format!("the file is cut short: its first {frames} frames are read"),
            });
        }
        Ok(video)
    }

    /// Number of frames, if the file has it in its headers.
    pub fn frames(&self) -> Option<usize> {
        match &self.by {
            By::H264(stream) => Some(stream.track().times.len()),
            By::Ffmpeg(stream) => {
                let times = &stream.about.times;
                (!times.is_empty()).then_some(times.len())
            }
        }
    }

    /// Time of each frame, ascending, seconds from the first.
    pub fn times(&self) -> &[f64] {
        match &self.by {
            By::H264(stream) => &stream.track().times,
            By::Ffmpeg(stream) => &stream.about.times,
        }
    }

    /// Notes for people: how pictures differ from the file, and what the file lacks.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The rotation from the file's pictures to those shown, where this process makes it: `ffmpeg` doesn't tell.
    pub fn orientation(&self) -> Orientation {
        match &self.by {
            By::H264(stream) => stream.track().orientation,
            By::Ffmpeg(_) => Orientation::AsStored,
        }
    }

    /// Width and height of one of the file's pixels, after the rotation, in square pixels of the pictures shown.
    pub fn pixel(&self) -> [f64; 2] {
        self.aspect.map_or([1.0; 2], Aspect::pixel)
    }

    /// Keeps the pixels as they are stored if that gives pictures of `size` (width, height) and square pixels don't: a capture may
    /// have been made of pictures whose pixels nobody made square.
    pub fn keep_pixels_for(&mut self, size: [u32; 2]) {
        let size = size.map(|side| side as usize);
        let stored = self.first.as_ref().map(|it| [it.width, it.height]);
        if stored == Some(size)
            && self.aspect.is_some_and(|it| it.size(size) != size)
            && let Some(note) = self.notes.first_mut()
        {
            self.aspect = None;
            *note = "pixels that are not square are kept: the pose track is of pictures with them"
                .into();
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

    /// The next frame shown, rotated by the file's display matrix, with square pixels and levels of ordinary video; `None` after
    /// the last. With `skip` the frame is decoded, since later frames depend on it, but not converted and not returned.
    ///
    /// # Errors
    /// If a frame can't be decoded, with its number.
    pub fn next(&mut self, skip: bool) -> Result<Option<Picture>, MediaError> {
        let raw = match self.first.take() {
            Some(first) => Some(first),
            None => self.raw(skip)?,
        };
        let Some(raw) = raw.filter(|_| !skip) else {
            return Ok(None);
        };
        let picture = Picture {
            width: raw.width,
            height: raw.height,
            rgb: match (&self.tone_map, raw.levels) {
                (Some(map), levels) => map.apply(&levels),
                (None, Levels::Eight(levels)) => levels,
                (None, Levels::Sixteen(levels)) => {
                    let rounded = |it: &u16| ((u32::from(*it) + 128) / 257) as u8;
                    levels.iter().map(rounded).collect()
                }
            },
            alpha: None,
            lossy: true,
        };
        Ok(Some(match self.aspect {
            Some(aspect) => aspect.apply(picture, &self.limits)?,
            None => picture,
        }))
    }

    fn raw(&mut self, skip: bool) -> Result<Option<Raw>, MediaError> {
        match &mut self.by {
            By::H264(stream) => stream.next(skip),
            By::Ffmpeg(stream) => stream.next(skip),
        }
    }
}

/// The kind of the file at `path`, by its first bytes.
fn sniffed(path: &Path) -> Result<sniff::FileType, MediaError> {
    let mut start = Vec::new();
    File::open(path)
        .and_then(|file| file.take(sniff::PREFIX as u64).read_to_end(&mut start))
        .map_err(MediaError::io(path))?;
    if start.is_empty() {
        return Err(MediaFault::new("EMPTY", "the file has no bytes").into());
    }
    Ok(sniff::kind(&start))
}
