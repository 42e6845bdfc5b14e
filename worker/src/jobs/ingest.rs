//! Turning an uploaded capture into a training shard.
//!
//! Everything wrong with the upload is collected, with file, frame and field, so that its
//! owner mends it in one go; frames are decoded one at a time, so that memory holds the
//! shard and a single picture.

use super::{JobContext, JobFailure, context::id};
use std::collections::HashMap;
use yoto_avatar::capture::check::{Checker, Grade, Report};
use yoto_avatar::capture::{CaptureError, FrameImage, ShardBuilder};
use yoto_proto::{
    keys,
    names::Collection,
    pose_track::{FILE, FILES, PoseTrack, violation},
    v1::{IngestResult, IngestSpec, Inputs, ObjectRef, Violation},
};

/// Most violations reported of one capture; a wrong export repeats in every frame.
const MAX_VIOLATIONS: usize = 20;

/// Checks, decodes and packs the capture.
///
/// # Errors
/// [`JobFailure::Rejected`] with what is wrong with the upload; faults of the store.
pub fn run(
    context: &JobContext,
    spec: &IngestSpec,
    inputs: &Inputs,
) -> Result<IngestResult, JobFailure> {
    let uploads = Uploads::new(inputs);
    let track = read_track(context, &uploads)?;
    let missing = uploads.missing(&track);
    if !missing.is_empty() {
        return Err(JobFailure::Rejected(missing));
    }
    let (builder, report) = decode(context, &uploads, track.clone())?;
    let shard = builder.finish().map_err(|error| packing(&error))?;
    let capture = id(Collection::Captures, &spec.capture)?;
    let key = keys::shard(capture, context.job_id()?, context.token);
    let check = keys::check(capture, context.job_id()?, context.token);
    let json = serde_json::to_vec(&report)
        .map_err(|error| JobFailure::failed("INTERNAL", "writing the check's report", &error))?;
    let [width, height] = track.image_size;
    Ok(IngestResult {
        shard: Some(context.put(&key, shard.to_bytes())?),
        frames: track.frames.len() as u32,
        width,
        height,
        check: Some(context.put(&check, json)?),
        warnings: warnings(&report),
    })
}

/// What the owner should know although the capture serves.
fn warnings(report: &Report) -> Vec<String> {
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

/// The uploaded files by path.
struct Uploads<'a>(HashMap<&'a str, &'a ObjectRef>);

impl<'a> Uploads<'a> {
    fn new(inputs: &'a Inputs) -> Self {
        let files = inputs.files.iter();
        Self(
            files
                .filter_map(|file| Some((file.path.as_str(), file.object.as_ref()?)))
                .collect(),
        )
    }

    /// A file's bytes; `None` when it was not uploaded.
    fn read(&self, context: &JobContext, path: &str) -> Result<Option<bytes::Bytes>, JobFailure> {
        match self.0.get(path) {
            Some(object) => Ok(Some(context.get(object)??)),
            None => Ok(None),
        }
    }

    /// The images and masks that `track` speaks of and nobody uploaded.
    fn missing(&self, track: &PoseTrack) -> Vec<Violation> {
        track
            .frames
            .iter()
            .flat_map(|frame| {
                [
                    (frame.index, image_path(frame.index)),
                    (frame.index, mask_path(frame.index)),
                ]
            })
            .filter(|(_, path)| !self.0.contains_key(path.as_str()))
            .map(|(index, path)| {
                violation(
                    "MISSING",
                    &path,
                    Some(index),
                    "",
                    "the pose track has this frame, but the file was not uploaded",
                )
            })
            .take(MAX_VIOLATIONS)
            .collect()
    }
}

fn image_path(index: u32) -> String {
    format!("frames/{index:06}.png")
}

fn mask_path(index: u32) -> String {
    format!("masks/{index:06}.png")
}

fn read_track(context: &JobContext, uploads: &Uploads<'_>) -> Result<PoseTrack, JobFailure> {
    for name in FILES {
        if let Some(bytes) = uploads.read(context, name)? {
            let track = PoseTrack::from_file(name, &bytes).map_err(JobFailure::Rejected)?;
            return match distorted(&track, name) {
                None => Ok(track),
                Some(fault) => Err(JobFailure::Rejected(vec![fault])),
            };
        }
    }
    Err(JobFailure::Rejected(vec![violation(
        "MISSING",
        FILE,
        None,
        "",
        "a capture needs a pose track",
    )]))
}

/// Training shoots straight rays: images that bend lines would be learned wrongly.
fn distorted(track: &PoseTrack, file: &str) -> Option<Violation> {
    let message = "images with lens distortion must be undistorted first";
    (!track.is_pinhole()).then(|| violation("DISTORTED", file, None, "distortion", message))
}

/// Every frame in order with the check's report on them, unless something is wrong with any.
/// What the check warns of is no fault; a capture that nothing can be learnt from is.
fn decode(
    context: &JobContext,
    uploads: &Uploads<'_>,
    track: PoseTrack,
) -> Result<(ShardBuilder, Report), JobFailure> {
    let indices: Vec<u32> = track.frames.iter().map(|frame| frame.index).collect();
    let size = track.image_size;
    let mut checker = Checker::new(track.clone())
        .map_err(|error| JobFailure::failed("INTERNAL", "checking the capture", &error))?;
    let mut builder = ShardBuilder::new(track);
    let mut violations = Vec::new();
    let mut anybody = false;
    for (done, &index) in indices.iter().enumerate() {
        context.check()?;
        context.report_pieces("decoding", done, indices.len());
        let names = (image_path(index), mask_path(index));
        let image = uploads.read(context, &names.0)?.unwrap_or_default();
        let mask = uploads.read(context, &names.1)?.unwrap_or_default();
        match FrameImage::decode(&image, &mask, size, index, (&names.0, &names.1)) {
            Ok(frame) if violations.is_empty() => {
                checker.look(done, &frame);
                anybody |= frame.mask.iter().any(|&coverage| coverage > 0);
                builder.push(&frame).map_err(|error| packing(&error))?;
            }
            // After a fault there is no shard to pack, but further faults are worth knowing.
            Ok(_) => {}
            Err(CaptureError::Invalid(found)) => violations.extend(found),
            Err(error) => return Err(packing(&error)),
        }
        if violations.len() >= MAX_VIOLATIONS {
            break;
        }
    }
    if violations.is_empty() && !anybody {
        violations.push(violation(
            "EMPTY",
            "masks",
            None,
            "",
            "no mask covers a single pixel: nobody can be seen",
        ));
    }
    if !violations.is_empty() {
        return Err(JobFailure::Rejected(violations));
    }
    let report = checker.finish();
    match report.pointless() {
        None => Ok((builder, report)),
        Some(reason) => Err(JobFailure::Rejected(vec![violation(
            "MISALIGNED",
            FILE,
            None,
            "",
            reason,
        )])),
    }
}

fn packing(error: &CaptureError) -> JobFailure {
    JobFailure::failed("INTERNAL", "packing the shard", error)
}

#[cfg(test)]
mod tests;
