//! H.264 in MP4, decoded by the bundled OpenH264.

use super::Raw;
use super::light::Levels;
use super::mp4::{Codec, VideoTrack};
use super::signal::Signal;
use super::sps::Sps;
use super::yuv::{Coding, Planes, to_deep_rgb, to_rgb};
use crate::{Limits, MediaError, MediaFault};
use openh264::decoder::{DecodeOptions, DecodedYUV, Decoder, Flush};
use openh264::formats::YUVSource;
use std::collections::VecDeque;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

const START_CODE: [u8; 4] = [0, 0, 0, 1];

/// The reason to use another decoder.
pub(super) enum Refusal {
    /// The bundled decoder does not support the stream. The caller's message ends "… is not decoded in-process".
    Unsupported(String),
    /// The file is at fault.
    Bad(MediaFault),
}

/// A stream, decoded frame by frame in the order shown.
pub(super) struct H264 {
    path: PathBuf,
    file: File,
    decoder: Decoder,
    track: VideoTrack,
    length_size: usize,
    /// Parameter sets, sent before the first packet.
    lead: Vec<u8>,
    coding: Coding,
    limits: Limits,
    /// Width and height as stored, pixels.
    pub(super) size: (u64, u64),
    pub(super) signal: Signal,
    /// Width and height of a stored pixel, if the file declares them.
    pub(super) aspect: Option<[u32; 2]>,
    /// Number of packets given to the decoder.
    fed: usize,
    /// Number of decoded frames.
    out: usize,
    /// Frames flushed at the end; `None` for skipped frames.
    tail: VecDeque<Result<Raw, MediaFault>>,
    flushed: bool,
}

impl std::fmt::Debug for H264 {
    fn fmt(&self, to: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            to,
            "H264({}, {} packets)",
            self.path.display(),
            self.track.packets.len()
        )
    }
}

impl H264 {
    /// Opens the stream of `track`, after a check of its parameter sets.
    pub(super) fn open(
        path: &Path,
        track: VideoTrack,
        limits: &Limits,
    ) -> Result<Result<Self, Refusal>, MediaError> {
        let Codec::H264 {
            length_size,
            sps,
            pps,
        } = track.codec.clone()
        else {
            return Ok(Err(Refusal::Unsupported("this codec".into())));
        };
        let bad = |message: &str| Ok(Err(Refusal::Bad(MediaFault::undecodable(message))));
        let Some(head) = sps.first().and_then(|nal| Sps::read(nal)) else {
            return bad("H.264: the sequence parameter set can't be read");
        };
        let most = u64::from(limits.side);
        if head.width > most || head.height > most {
            let message = format!(
                "declares {}x{} pixels; each side must be at most {most}",
                head.width, head.height
            );
            return Ok(Err(Refusal::Bad(MediaFault::new("TOO_LARGE", message))));
        }
        let signal = Signal::of(head.colour, track.colour);
        let coding = Coding::new(signal.matrix, signal.full_range);
        let (Some(coding), 1, 8, false) =
            (coding, head.chroma_format, head.bit_depth, head.interlaced)
        else {
            let message = format!(
                "H.264 with {} bits, chroma format {}, colour matrix {}{}",
                head.bit_depth,
                head.chroma_format,
                signal.matrix,
                if head.interlaced { ", interlaced" } else { "" }
            );
            return Ok(Err(Refusal::Unsupported(message)));
        };
        let Ok(decoder) = Decoder::new() else {
            return bad("H.264: the decoder can't be started");
        };
        let mut lead = Vec::new();
        for nal in sps.iter().chain(&pps) {
            lead.extend_from_slice(&START_CODE);
            lead.extend_from_slice(nal);
        }
        Ok(Ok(Self {
            file: File::open(path).map_err(MediaError::io(path))?,
            path: path.to_owned(),
            decoder,
            // The container's is the later decision, as in ffmpeg.
            aspect: track.aspect.or(head.aspect),
            signal,
            track,
            length_size,
            lead,
            coding,
            limits: limits.clone(),
            size: (head.width, head.height),
            fed: 0,
            out: 0,
            tail: VecDeque::new(),
            flushed: false,
        }))
    }

    pub(super) fn track(&self) -> &VideoTrack {
        &self.track
    }

    /// The next frame shown; `None` after the last. With `skip` it is decoded but not
    /// converted, and not returned.
    pub(super) fn next(&mut self, skip: bool) -> Result<Option<Raw>, MediaError> {
        loop {
            let hidden = self.out < self.track.hidden;
            if self.out >= self.track.hidden + self.track.times.len() {
                return Ok(None);
            }
            let Some(decoded) = self.decode(skip || hidden)? else {
                return Ok(None);
            };
            self.out += 1;
            if !hidden {
                return Ok(decoded.map(|raw| raw.turned(self.track.orientation)));
            }
        }
    }

    /// The decoder's next frame: outer `None` at the end, inner `None` for a skipped frame.
    fn decode(&mut self, skip: bool) -> Result<Option<Option<Raw>>, MediaError> {
        // Eight bits are too few for light of a hundred times the range.
        let is_deep = self.signal.light().is_some();
        while self.fed < self.track.packets.len() {
            let packet = self.packet()?;
            let shown = self.track.rank.get(self.fed).copied().unwrap_or(self.fed);
            self.fed += 1;
            let options = DecodeOptions::new().flush_after_decode(Flush::NoFlush);
            let decoded = self
                .decoder
                .decode_with_options(&packet, options)
                .map_err(|error| {
                    let shown = shown.saturating_sub(self.track.hidden);
                    MediaFault::undecodable(format!("H.264: {error}")).in_frame(shown)
                })?;
            if let Some(yuv) = decoded {
                if skip {
                    return Ok(Some(None));
                }
                return Ok(Some(Some(convert(&yuv, self.coding, is_deep, self.size)?)));
            }
        }
        if !self.flushed {
            self.flushed = true;
            let flushed = self.decoder.flush_remaining();
            let rest =
                flushed.map_err(|error| MediaFault::undecodable(format!("H.264: {error}")))?;
            self.tail = rest
                .iter()
                .map(|yuv| convert(yuv, self.coding, is_deep, self.size))
                .collect();
        }
        match self.tail.pop_front() {
            Some(picture) => Ok(Some(Some(picture?))),
            None if self.out < self.track.packets.len() => {
                let message = format!(
                    "H.264: only {} of {} frames could be decoded",
                    self.out,
                    self.track.packets.len()
                );
                let shown = self.out.saturating_sub(self.track.hidden);
                Err(MediaFault::undecodable(message).in_frame(shown).into())
            }
            None => Ok(None),
        }
    }

    /// The next packet in the decoder's form: start codes instead of lengths.
    fn packet(&mut self) -> Result<Vec<u8>, MediaError> {
        let (offset, size) = self
            .track
            .packets
            .get(self.fed)
            .copied()
            .unwrap_or_default();
        let shown = self.track.rank.get(self.fed).copied().unwrap_or(self.fed);
        let at = |fault: MediaFault| fault.in_frame(shown.saturating_sub(self.track.hidden));
        // The sample table's size is untrusted: it is compared before it is allocated.
        if size > self.limits.file_bytes {
            let message = format!("a coded frame of {size} bytes");
            return Err(at(MediaFault::new("TOO_LARGE", message)).into());
        }
        let mut coded = vec![0; size as usize];
        self.file
            .seek(SeekFrom::Start(offset))
            .and_then(|_| self.file.read_exact(&mut coded))
            .map_err(MediaError::io(&self.path))?;
        let mut packet = if self.fed == 0 {
            self.lead.clone()
        } else {
            Vec::new()
        };
        let mut rest = coded.as_slice();
        while !rest.is_empty() {
            let unit = rest
                .split_at_checked(self.length_size)
                .and_then(|(length, tail)| {
                    // At most 4 bytes (`parameter_sets`), so the sum can't overflow.
                    let length = length
                        .iter()
                        .fold(0usize, |sum, &byte| sum << 8 | usize::from(byte));
                    tail.split_at_checked(length)
                });
            let Some((unit, tail)) = unit else {
                return Err(at(MediaFault::undecodable(
                    "H.264: a unit is longer than its frame",
                ))
                .into());
            };
            packet.extend_from_slice(&START_CODE);
            packet.extend_from_slice(unit);
            rest = tail;
        }
        Ok(packet)
    }
}

fn convert(
    yuv: &DecodedYUV<'_>,
    coding: Coding,
    is_deep: bool,
    declared: (u64, u64),
) -> Result<Raw, MediaFault> {
    let ((width, height), (sy, su, sv)) = (yuv.dimensions(), yuv.strides());
    // A stream may change its parameter sets midway; only the first ones were checked against the limits.
    if (width as u64, height as u64) != declared {
        let message = format!(
            "H.264: a frame of {width}x{height} pixels in a video of {}x{}",
            declared.0, declared.1
        );
        return Err(MediaFault::new("SIZE_MISMATCH", message));
    }
    let planes = Planes {
        width,
        height,
        y: (yuv.y(), sy),
        u: (yuv.u(), su),
        v: (yuv.v(), sv),
    };
    let levels = match is_deep {
        false => to_rgb(planes, coding).map(Levels::Eight),
        true => to_deep_rgb(planes, coding).map(Levels::Sixteen),
    };
    let levels =
        levels.ok_or_else(|| MediaFault::undecodable("H.264: a frame without all its planes"))?;
    Ok(Raw {
        width,
        height,
        levels,
    })
}
