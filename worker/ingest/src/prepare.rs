//! The child's work: files in, shard and the check's report out.

use super::capture::Capture;
use super::failure::ReadFailure;
use super::order::{Order, Prepared, Progress, Stage};
use super::reader::Reader;
use super::{MAX_VIOLATIONS, edges};
use std::fs::File;
use std::io::{BufWriter, Seek, Write};
use std::time::{Duration, Instant};
use yoto_capture::check::{CheckReport, Checker, Grade};
use yoto_capture::{CaptureError, ShardBuilder};
use yoto_media::video::Ffmpeg;
use yoto_proto::pose_track::{self, violation};

/// Checks, decodes and packs the capture; `tell` receives the progress.
///
/// All faults are collected, up to a limit, so that the owner can correct them at once. Warnings of
/// the check are not faults; a capture that is useless for training is. Memory holds a few
/// pictures: crops go to disk.
pub(super) fn prepare(
    order: &Order,
    ffmpeg: &Ffmpeg,
    tell: &mut dyn FnMut(Progress),
) -> Result<Prepared, ReadFailure> {
    for name in order.files.keys() {
        tell(Progress {
            file: name.clone(),
            ..Progress::default()
        });
    }
    let capture = Capture::read(&order.folder, &order.files, &order.limits)?;
    let total = capture.track.frames.len();
    let positions: Vec<usize> = (0..total).collect();
    let edges = edges::learned(&capture, ffmpeg, tell);
    let mut reader = capture.reader(&positions, edges, ffmpeg, tell)?;
    let pixels = order.folder.join("pixels.bin");
    let sink = File::options()
        .create(true)
        .truncate(true)
        .read(true)
        .write(true)
        .open(&pixels)
        .map_err(disk)?;
    let mut builder = ShardBuilder::writing_to(BufWriter::new(sink), capture.track.clone());
    let began = Instant::now();
    let (report, decoding) = decode(&capture, &mut reader, &mut builder, tell)?;
    let a_second = |time: Duration| total as f64 / time.as_secs_f64().max(1e-9);
    let (decoded, checked) = (a_second(decoding), a_second(began.elapsed()));

    let (head, sink) = builder
        .finish_head()
        .map_err(|error| packing(error, pose_track::FILE))?;
    let mut sink = sink
        .into_inner()
        .map_err(|error| disk(error.into_error()))?;
    let mut shard = File::create(order.shard()).map_err(disk)?;
    shard.write_all(&head).map_err(disk)?;
    sink.rewind().map_err(disk)?;
    let crops = std::io::copy(&mut sink, &mut shard).map_err(disk)?;
    std::fs::remove_file(&pixels).map_err(disk)?;
    let json = serde_json::to_vec(&report).map_err(|error| disk(error.into()))?;
    std::fs::write(order.check(), json).map_err(disk)?;
    let mut notes = reader.notes;
    let bytes = head.len() as u64 + crops;
    let [width, height] = capture.track.image_size;
    notes.push(format!(
        "{} bytes per frame: {bytes} for {total} frames of {width}x{height}, cropped to the person",
        bytes / total.max(1) as u64,
    ));
    notes.push(format!(
        "decoded {decoded:.0} frames per second, {checked:.0} with the check and packing{}",
        peak_memory().unwrap_or_default()
    ));
    Ok(Prepared {
        notes,
        warnings: warnings(&report),
    })
}

/// Packs and checks all frames in order, unless one has a fault. Returns the check's report, and
/// the time to decode pictures and masks.
fn decode<W: Write>(
    capture: &Capture,
    reader: &mut Reader,
    builder: &mut ShardBuilder<W>,
    tell: &mut dyn FnMut(Progress),
) -> Result<(CheckReport, Duration), ReadFailure> {
    let track = &capture.track;
    let total = track.frames.len();
    let mut checker = Checker::new(track.clone())
        .map_err(|error| ReadFailure::Machine(format!("checking the capture: {error}")))?;
    let mut faults = Vec::new();
    let mut anybody = false;
    let mut decoding = Duration::ZERO;
    for (done, (frame, &mask)) in track.frames.iter().zip(&capture.masks).enumerate() {
        tell(Progress {
            stage: Stage::Decoding,
            file: reader.file_of(frame.index).to_owned(),
            frame: Some(frame.index),
            done,
            total,
        });
        let began = Instant::now();
        let image = reader.frame(frame, mask, track.image_size);
        decoding += began.elapsed();
        match image {
            Ok(image) if faults.is_empty() => {
                anybody |= image.mask.iter().any(|&coverage| coverage > 0);
                checker.look(done, &image);
                builder
                    .push(&image)
                    .map_err(|error| packing(error, reader.file_of(frame.index)))?;
            }
            // After a fault there is no shard to pack, but the owner needs all faults.
            Ok(_) => {}
            Err(ReadFailure::Rejected(found)) => faults.extend(found),
            Err(machine) => return Err(machine),
        }
        if faults.len() >= MAX_VIOLATIONS || (!faults.is_empty() && reader.is_video) {
            break;
        }
    }
    if faults.is_empty() && !anybody {
        let message = "no mask covers a single pixel: there is no person";
        faults.push(violation("EMPTY", "masks", None, "", message));
    }
    if !faults.is_empty() {
        return Err(ReadFailure::Rejected(faults));
    }
    let report = checker.finish();
    match report.pointless() {
        None => Ok((report, decoding)),
        Some(reason) => {
            let fault = violation("MISALIGNED", pose_track::FILE, None, "", reason);
            Err(ReadFailure::of(fault))
        }
    }
}

/// Peak memory of this process, if the system reports it. (`getrusage` would include the memory
/// of the worker at the start of this process.)
fn peak_memory() -> Option<String> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|it| it.strip_prefix("VmHWM:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(format!(", in {} MiB of memory at most", kib >> 10))
}

/// Warnings for the owner of a valid capture.
fn warnings(report: &CheckReport) -> Vec<String> {
    let measures = report.measures.iter();
    measures
        .filter(|it| it.grade != Grade::Pass)
        .map(|it| {
            let cause = it.cause.as_ref().map(|cause| format!(": {cause}"));
            let (title, shown) = (it.kind.title(), &it.shown);
            format!("{title}: {shown}{}", cause.unwrap_or_default())
        })
        .collect()
}

fn disk(error: std::io::Error) -> ReadFailure {
    ReadFailure::Machine(format!("writing the shard: {error}"))
}

/// A builder's fault; `file` is the file if the builder does not know it.
fn packing(error: CaptureError, file: &str) -> ReadFailure {
    match error {
        CaptureError::Invalid(mut found) => {
            for fault in found.iter_mut().filter(|fault| fault.file.is_empty()) {
                file.clone_into(&mut fault.file);
            }
            ReadFailure::Rejected(found)
        }
        other => ReadFailure::Machine(other.to_string()),
    }
}

#[cfg(test)]
#[path = "prepare_tests.rs"]
mod tests;
