//! MP4 and MOV: the video track, its codec, and its frames.

mod samples;
mod tree;

use super::signal::Signal;
use crate::{Limits, MediaError, MediaFault, Orientation};
use re_mp4::{MdhdBox, TkhdBox};
use samples::Samples;
use std::path::Path;
use tree::{Atom, broken, children, headers};

/// The video track of a file.
#[derive(Debug)]
pub(super) struct VideoTrack {
    /// Coding.
    pub(super) codec: Codec,
    /// Orientation by the display matrix.
    pub(super) orientation: Orientation,
    /// Coded frames in decoding order: byte offset and length.
    pub(super) packets: Vec<(u64, u64)>,
    /// Index of each packet's frame in the order shown.
    pub(super) rank: Vec<usize>,
    /// Time of each frame, ascending, seconds from the first one shown.
    pub(super) times: Vec<f64>,
    /// Number of frames, in the order shown, before the track's start: decoded but never shown.
    pub(super) hidden: usize,
    /// Range and colours, if the container declares them.
    pub(super) colour: Option<Signal>,
    /// Width and height of a pixel, if the container declares them.
    pub(super) aspect: Option<[u32; 2]>,
    /// Number of frames that the file's headers list, if it ends before the last of them.
    pub(super) listed: Option<usize>,
}

/// Coding of a track.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Codec {
    /// H.264 with parameter sets beside the frames.
    H264 {
        /// Bytes of the length field before each unit, 1 to 4.
        length_size: usize,
        /// Sequence parameter sets.
        sps: Vec<Vec<u8>>,
        /// Picture parameter sets.
        pps: Vec<Vec<u8>>,
    },
    /// Anything else, by its four letters.
    Other(String),
}

/// Reads the headers of the file at `path`.
///
/// # Errors
/// If the file is cut short, has no video, or has more frames than allowed.
pub(super) fn open(path: &Path, limits: &Limits) -> Result<VideoTrack, MediaError> {
    let headers = headers(path)?;
    let moov = Atom::bare(*b"moov", &headers.moov);
    let mut best: Option<VideoTrack> = None;
    for trak in moov.children()?.iter().filter(|it| &it.name == b"trak") {
        if handler(trak)? != *b"vide" {
            continue;
        }
        let tkhd: TkhdBox = trak.child(b"tkhd")?.read()?;
        let samples = samples::samples(trak, tkhd.track_id, &moov, &headers, limits)?;
        let track = track(trak, &tkhd, &samples)?;
        // The longest track: a cover picture is also a video track, with a single frame.
        if best
            .as_ref()
            .is_none_or(|it| it.packets.len() < track.packets.len())
        {
            best = Some(track);
        }
    }
    let track = best.ok_or_else(|| MediaFault::undecodable("the file has no video track"))?;
    if track.packets.is_empty() {
        return Err(MediaFault::new("EMPTY", "the video has no frames").into());
    }
    Ok(track)
}

/// The four letters of a track's kind, e.g. `vide`.
fn handler(trak: &Atom<'_>) -> Result<[u8; 4], MediaFault> {
    let hdlr = trak.child(b"mdia")?.child(b"hdlr")?;
    let kind = hdlr.content().get(8..12).and_then(|it| it.try_into().ok());
    kind.ok_or_else(|| broken("its 'hdlr' box is cut short"))
}

fn track(trak: &Atom<'_>, tkhd: &TkhdBox, samples: &Samples) -> Result<VideoTrack, MediaFault> {
    let mdia = trak.child(b"mdia")?;
    let mdhd: MdhdBox = mdia.child(b"mdhd")?.read()?;
    let scale = f64::from(mdhd.timescale.max(1));
    let stsd = mdia.child(b"minf")?.child(b"stbl")?.child(b"stsd")?;
    let matrix = &tkhd.matrix;
    let orientation =
        Orientation::from_matrix(matrix.a, matrix.b, matrix.c, matrix.d).ok_or_else(|| {
            let message = "the display matrix mirrors or skews the picture, which cameras never do";
            MediaFault::new("UNSUPPORTED", message)
        })?;
    let (name, boxes) = entry(&stsd)?;
    let content = |name: &[u8; 4]| Some(boxes.iter().find(|it| &it.name == name)?.content());
    let colours = boxes.iter().filter(|it| &it.name == b"colr");
    let Samples { samples, missing } = samples;
    let mut order: Vec<usize> = (0..samples.len()).collect();
    // Stable: frames with equal times stay in decoding order.
    order.sort_by_key(|&packet| samples.get(packet).map_or(0, |it| it.shown));
    let mut rank = vec![0; samples.len()];
    for (position, &packet) in order.iter().enumerate() {
        if let Some(rank) = rank.get_mut(packet) {
            *rank = position;
        }
    }
    let mut shown: Vec<i64> = samples.iter().map(|it| it.shown).collect();
    shown.sort_unstable();
    let start = samples::start_of_edit(trak)?;
    let mut hidden = shown.partition_point(|&it| it < start);
    // An edit list that starts after the last frame would hide all of them; it is ignored.
    if hidden == shown.len() {
        hidden = 0;
    }
    // Of a file that is cut short, frames shown after the first missing one are decoded without those that they build on.
    let end = missing.map_or(shown.len(), |it| shown.partition_point(|&at| at < it.shown));
    let listed = missing.map(|it| (shown.len() + it.count).saturating_sub(hidden));
    shown.truncate(end);
    let first = shown.get(hidden).copied().unwrap_or(0);
    let times: Vec<f64> = shown
        .iter()
        .skip(hidden)
        .map(|&it| it.saturating_sub(first) as f64 / scale)
        .collect();
    if times.is_empty() && missing.is_some() {
        let message = "the file is cut short before the end of the first frame that is shown";
        return Err(MediaFault::new("TRUNCATED", message));
    }
    Ok(VideoTrack {
        codec: codec(&name, &boxes)?,
        orientation,
        packets: samples.iter().map(|it| (it.offset, it.size)).collect(),
        rank,
        times,
        hidden,
        colour: colours
            .filter_map(|it| Signal::from_box(it.content()))
            .next(),
        aspect: content(b"pasp").and_then(aspect),
        listed,
    })
}

/// The first sample entry: its four letters and its own boxes.
fn entry<'a>(stsd: &Atom<'a>) -> Result<([u8; 4], Vec<Atom<'a>>), MediaFault> {
    // Eight bytes of version, flags and count come before the entries.
    let entries = children(stsd.content().get(8..).unwrap_or_default())?;
    let entry = entries
        .first()
        .ok_or_else(|| broken("its 'stsd' box is empty"))?;
    // A visual sample entry has 78 bytes before its own boxes. What follows them is not always boxes.
    let inner = children(entry.content().get(78..).unwrap_or_default());
    match inner {
        Err(fault) if is_h264(&entry.name) => Err(fault),
        inner => Ok((entry.name, inner.unwrap_or_default())),
    }
}

fn is_h264(name: &[u8; 4]) -> bool {
    name == b"avc1" || name == b"avc3"
}

/// The codec of a sample entry.
fn codec(name: &[u8; 4], boxes: &[Atom<'_>]) -> Result<Codec, MediaFault> {
    let content = |name: &[u8; 4]| Some(boxes.iter().find(|it| &it.name == name)?.content());
    // Version, then seven bits of the profile; the last four bits of the fifth byte say what a player without Dolby Vision sees.
    let vision = content(b"dvcC").or_else(|| content(b"dvvC"));
    if vision
        .and_then(|it| it.get(2))
        .is_some_and(|it| it >> 1 == 5)
    {
        let message = "Dolby Vision of profile 5 has colours that only its own decoders read: export it as HLG, HDR10 or SDR";
        return Err(MediaFault::new("UNSUPPORTED", message));
    }
    if !is_h264(name) {
        return Ok(Codec::Other(
            String::from_utf8_lossy(name).trim().to_owned(),
        ));
    }
    let config = content(b"avcC").ok_or_else(|| broken("its H.264 track has no 'avcC' box"))?;
    parameter_sets(config).ok_or_else(|| broken("its 'avcC' box is cut short"))
}

/// Width and height of a pixel by a `pasp` box.
fn aspect(content: &[u8]) -> Option<[u32; 2]> {
    let (words, _) = content.as_chunks::<4>();
    Some([*words.first()?, *words.get(1)?].map(u32::from_be_bytes))
}

/// The parameter sets in `avcC`: version, profile, compatibility, level, length size, then the two lists.
/// `None` if it is cut short.
fn parameter_sets(bytes: &[u8]) -> Option<Codec> {
    let length_size = usize::from(bytes.get(4)? & 3) + 1;
    let mut rest = bytes.get(5..)?;
    let mut list = |mask: u8| -> Option<Vec<Vec<u8>>> {
        let (&count, mut tail) = rest.split_first()?;
        let mut sets = Vec::new();
        for _ in 0..count & mask {
            let length = u16::from_be_bytes(tail.get(..2)?.try_into().ok()?);
            let (set, after) = tail.get(2..)?.split_at_checked(usize::from(length))?;
            sets.push(set.to_vec());
            tail = after;
        }
        rest = tail;
        Some(sets)
    };
    Some(Codec::H264 {
        length_size,
        sps: list(0x1f)?,
        pps: list(0xff)?,
    })
}
