//! Opens a capture's files: its plan, its pose track, and the sources of its pictures.

use super::edges::Edges;
use super::failure::ReadFailure;
use super::order::Progress;
use super::reader::Reader;
use super::unpack::{OWN_PLAN, unpacked};
use super::video_end::end_with_videos;
use std::path::Path;
use yoto_media::Limits;
use yoto_media::archive::Files;
use yoto_media::source::read_file;
use yoto_media::video::Ffmpeg;
use yoto_proto::media_plan::{self, MediaPlan, Planned, Sources};
use yoto_proto::pose_track::{self, FILES, NO_DISTORTION, PoseTrack, violation};

/// A capture with unpacked archives and a valid pose track.
#[derive(Debug)]
pub(super) struct Capture {
    /// Path in the capture to path on this disk.
    pub(super) files: Files,
    /// Limits of a capture.
    pub(super) limits: Limits,
    /// The plan for reading it.
    pub(super) plan: MediaPlan,
    /// Sources of pictures and masks.
    pub(super) sources: Sources,
    /// The selected frames, by ascending index, without distortion.
    pub(super) track: PoseTrack,
    /// Index of each frame's mask.
    pub(super) masks: Vec<u32>,
    /// Distortion of the stored pictures.
    pub(super) distortion: [f64; 5],
    /// Changes and omissions, for people.
    pub(super) notes: Vec<String>,
}

impl Capture {
    /// Reads everything except the pictures; archives are unpacked into `folder`.
    ///
    /// # Errors
    /// Faults of the files, and of this machine.
    pub(super) fn read(folder: &Path, files: &Files, limits: &Limits) -> Result<Self, ReadFailure> {
        let files = unpacked(folder, files, limits)?;
        let there = FILES
            .into_iter()
            .find_map(|name| Some((name, files.get(name)?)));
        let (name, path) = there.ok_or_else(|| {
            let message = "a capture needs a pose track";
            ReadFailure::of(violation("MISSING", pose_track::FILE, None, "", message))
        })?;
        let plan =
            read_plan(media_plan::FILE, &files, limits)?.over(read_plan(OWN_PLAN, &files, limits)?);
        let bytes = read_file(path, limits).map_err(|error| ReadFailure::at(error, name, None))?;
        let mut planned = plan.track(name, &bytes).map_err(ReadFailure::Rejected)?;
        let sources =
            Sources::find(&plan, files.keys().map(String::as_str)).map_err(ReadFailure::of)?;
        end_with_videos(&mut planned, &sources, &files, plan.timing, limits)
            .map_err(ReadFailure::of)?;
        let Planned {
            mut track,
            masks,
            notes,
        } = planned;
        // Training casts straight rays, so its frames have no distortion.
        let distortion = std::mem::replace(&mut track.distortion, NO_DISTORTION);
        Ok(Self {
            limits: limits.clone(),
            files,
            plan,
            sources,
            track,
            masks,
            distortion,
            notes,
        })
    }

    /// Opens the pictures of the frames at `positions`, which must be ascending. The masks' edges are treated as `edges`
    /// says.
    ///
    /// # Errors
    /// The frames without a picture or mask, up to a limit; a video that can't be read.
    pub(super) fn reader(
        &self,
        positions: &[usize],
        edges: Edges,
        ffmpeg: &Ffmpeg,
        tell: &mut dyn FnMut(Progress),
    ) -> Result<Reader, ReadFailure> {
        let mut reader = Reader::open(self, positions, ffmpeg, tell)?;
        reader.solve(edges);
        Ok(reader)
    }
}

fn read_plan(name: &str, files: &Files, limits: &Limits) -> Result<MediaPlan, ReadFailure> {
    let Some(path) = files.get(name) else {
        return Ok(MediaPlan::default());
    };
    let json = read_file(path, limits).map_err(|error| ReadFailure::at(error, name, None))?;
    serde_json::from_slice(&json).map_err(|error| {
        let field = format!("line {} column {}", error.line(), error.column());
        ReadFailure::of(violation(
            "UNREADABLE",
            name,
            None,
            field,
            error.to_string(),
        ))
    })
}
