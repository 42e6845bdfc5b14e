//! Position and time of each frame, expanded from MP4's tables.

use super::tree::{Atom, Headers, broken, children};
use crate::{Limits, MediaFault};
use re_mp4::{
    Co64Box, CttsBox, ElstBox, StcoBox, StscBox, StszBox, SttsBox, TfdtBox, TfhdBox, TrexBox,
    TrunBox,
};

/// One coded frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Sample {
    /// Byte offset in the file.
    pub(super) offset: u64,
    /// Bytes.
    pub(super) size: u64,
    /// Presentation time, in the track's units.
    pub(super) shown: i64,
}

/// Frames that a file's headers list and that it ends before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Missing {
    /// Number of frames.
    pub(super) count: usize,
    /// Earliest presentation time, in the track's units.
    pub(super) shown: i64,
}

/// The frames of a track.
#[derive(Debug)]
pub(super) struct Samples {
    /// The samples in the file, in decoding order, up to the first that is not in it.
    pub(super) samples: Vec<Sample>,
    /// The others, if the file is cut short.
    pub(super) missing: Option<Missing>,
}

/// All frames of a track.
///
/// # Errors
/// If the tables are invalid, or if the file is cut short before its first frame's end.
pub(super) fn samples(
    trak: &Atom<'_>,
    track: u32,
    moov: &Atom<'_>,
    headers: &Headers,
    limits: &Limits,
) -> Result<Samples, MediaFault> {
    let stbl = trak.child(b"mdia")?.child(b"minf")?.child(b"stbl")?;
    let mut samples = table(&stbl, limits)?;
    let defaults = defaults(moov, track)?;
    let mut decoded = 0i64;
    for (start, content) in &headers.moofs {
        for traf in children(content)?.iter().filter(|it| &it.name == b"traf") {
            fragment(
                traf,
                *start,
                track,
                &defaults,
                &mut decoded,
                &mut samples,
                limits,
            )?;
        }
    }
    // A file that was cut short is found here, before any frame is decoded.
    let is_cut = |it: &Sample| {
        let end = it.offset.checked_add(it.size);
        end.is_none_or(|end| end > headers.size)
    };
    let Some(first) = samples.iter().position(is_cut) else {
        // Frames of a fragment whose own header is cut are not counted.
        let missing = headers.is_cut.then_some(Missing {
            count: 0,
            shown: i64::MAX,
        });
        return Ok(Samples { samples, missing });
    };
    if let (0, Some(sample)) = (first, samples.first()) {
        let message = format!(
            "the file is cut short: its first frame's {} bytes start at byte {}, the file has {}",
            sample.size, sample.offset, headers.size
        );
        return Err(MediaFault::new("TRUNCATED", message).in_frame(0));
    }
    let lost = samples.split_off(first);
    let missing = Missing {
        count: lost.len(),
        shown: lost.iter().map(|it| it.shown).min().unwrap_or(i64::MAX),
    };
    Ok(Samples {
        samples,
        missing: Some(missing),
    })
}

/// The media time at which the track's edit list starts, in the track's units.
pub(super) fn start_of_edit(trak: &Atom<'_>) -> Result<i64, MediaFault> {
    let Some(edits) = trak.maybe(b"edts")? else {
        return Ok(0);
    };
    let Some(list) = edits.maybe(b"elst")? else {
        return Ok(0);
    };
    let list: ElstBox = list.read()?;
    // The media time -1, of 32 or 64 bits, is an empty edit: a pause before the first frame.
    let empty = |time: u64| time == u64::from(u32::MAX) || time == u64::MAX;
    let first = list.entries.iter().find(|it| !empty(it.media_time));
    Ok(first.map_or(0, |it| i64::try_from(it.media_time).unwrap_or(0)))
}

fn too_many(limits: &Limits) -> MediaFault {
    let message = format!("the video has more than {} frames", limits.frames);
    MediaFault::new("TOO_LARGE", message)
}

/// The frames that `stbl` lists.
fn table(stbl: &Atom<'_>, limits: &Limits) -> Result<Vec<Sample>, MediaFault> {
    let sizes: StszBox = stbl.child(b"stsz")?.read()?;
    // With one size for all frames, the count is not bounded by the box's length: a few bytes may declare
    // four billion frames.
    let count = sizes.sample_count as usize;
    if count > limits.frames {
        return Err(too_many(limits));
    }
    let size = |sample: usize| match sizes.sample_size {
        0 => sizes.sample_sizes.get(sample).copied().map(u64::from),
        all => Some(u64::from(all)),
    };
    let chunks: Vec<u64> = match stbl.maybe(b"stco")? {
        Some(table) => table
            .read::<StcoBox>()?
            .entries
            .into_iter()
            .map(u64::from)
            .collect(),
        None => stbl.child(b"co64")?.read::<Co64Box>()?.entries,
    };
    let mut samples = Vec::with_capacity(count);
    let runs = runs(&stbl.child(b"stsc")?)?;
    'chunks: for (chunk, &start) in chunks.iter().enumerate() {
        let run = runs.partition_point(|&(first, _)| first <= chunk as u64 + 1);
        let per_chunk = run
            .checked_sub(1)
            .and_then(|run| runs.get(run))
            .map_or(0, |run| run.1);
        let mut offset = start;
        for _ in 0..per_chunk {
            let Some(size) = size(samples.len()).filter(|_| samples.len() < count) else {
                break 'chunks;
            };
            samples.push(Sample {
                offset,
                size,
                shown: 0,
            });
            offset = offset.saturating_add(size);
        }
    }
    if samples.len() < count {
        let message = format!("lists {count} frames, but places only {}", samples.len());
        return Err(broken(message));
    }
    let durations: SttsBox = stbl.child(b"stts")?.read()?;
    // Runs are expanded lazily: their counts are untrusted, and only as many entries are taken as there
    // are frames.
    let mut durations = durations
        .entries
        .iter()
        .flat_map(|run| std::iter::repeat_n(run.sample_delta, run.sample_count as usize));
    let offsets = match stbl.maybe(b"ctts")? {
        Some(table) => table.read::<CttsBox>()?.entries,
        None => Vec::new(),
    };
    let mut offsets = offsets
        .iter()
        .flat_map(|run| std::iter::repeat_n(run.sample_offset, run.sample_count as usize));
    let mut decoded = 0i64;
    for sample in &mut samples {
        sample.shown = decoded.saturating_add(i64::from(offsets.next().unwrap_or(0)));
        decoded = decoded.saturating_add(i64::from(durations.next().unwrap_or(0)));
    }
    Ok(samples)
}

/// `stsc`: first chunk (from 1) and frames per chunk, of each run of chunks.
fn runs(stsc: &Atom<'_>) -> Result<Vec<(u64, u32)>, MediaFault> {
    let table: StscBox = stsc.read()?;
    let runs: Vec<(u64, u32)> = table
        .entries
        .iter()
        .map(|it| (u64::from(it.first_chunk), it.samples_per_chunk))
        .collect();
    // `table` searches the runs by bisection.
    if runs.is_sorted_by(|a, b| a.0 < b.0) {
        Ok(runs)
    } else {
        Err(broken("its chunks are out of order"))
    }
}

/// Defaults for fragments of the track: duration and size.
fn defaults(moov: &Atom<'_>, track: u32) -> Result<(u32, u32), MediaFault> {
    let Some(mvex) = moov.maybe(b"mvex")? else {
        return Ok((0, 0));
    };
    for trex in mvex.children()?.iter().filter(|it| &it.name == b"trex") {
        let trex: TrexBox = trex.read()?;
        if trex.track_id == track {
            return Ok((trex.default_sample_duration, trex.default_sample_size));
        }
    }
    Ok((0, 0))
}

/// Appends the frames of one fragment.
fn fragment(
    traf: &Atom<'_>,
    moof: u64,
    track: u32,
    defaults: &(u32, u32),
    decoded: &mut i64,
    samples: &mut Vec<Sample>,
    limits: &Limits,
) -> Result<(), MediaFault> {
    let tfhd: TfhdBox = traf.child(b"tfhd")?.read()?;
    if tfhd.track_id != track {
        return Ok(());
    }
    if let Some(tfdt) = traf.maybe(b"tfdt")? {
        let tfdt: TfdtBox = tfdt.read()?;
        *decoded = i64::try_from(tfdt.base_media_decode_time).unwrap_or(i64::MAX);
    }
    let base = tfhd.base_data_offset.unwrap_or(moof);
    let mut next = base;
    for trun in traf.children()?.iter().filter(|it| &it.name == b"trun") {
        // The count follows version and flags. It is checked before `re_mp4` allocates its entries.
        let count = trun.content().get(4..8).and_then(|it| it.try_into().ok());
        let count = u32::from_be_bytes(count.unwrap_or_default()) as usize;
        if samples.len().saturating_add(count) > limits.frames {
            return Err(too_many(limits));
        }
        let trun: TrunBox = trun.read()?;
        if let Some(offset) = trun.data_offset {
            next = base.saturating_add_signed(i64::from(offset));
        }
        for index in 0..trun.sample_count as usize {
            let or = |list: &[u32], own: Option<u32>, default: u32| {
                list.get(index).copied().or(own).unwrap_or(default)
            };
            let duration = or(
                &trun.sample_durations,
                tfhd.default_sample_duration,
                defaults.0,
            );
            let size = u64::from(or(&trun.sample_sizes, tfhd.default_sample_size, defaults.1));
            // Offsets are unsigned in version 0 and signed in version 1. Real unsigned ones are far too
            // small to look negative.
            let offset = trun.sample_cts.get(index).map_or(0, |&it| it as i32);
            samples.push(Sample {
                offset: next,
                size,
                shown: decoded.saturating_add(i64::from(offset)),
            });
            next = next.saturating_add(size);
            *decoded = decoded.saturating_add(i64::from(duration));
        }
    }
    Ok(())
}
