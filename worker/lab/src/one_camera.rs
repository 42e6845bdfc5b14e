//! Captures as users have them: one camera, and no pictures besides the film.

use crate::captures::{HeldOutPicture, Recording, Split};
use anyhow::{Context, ensure};
use std::path::Path;
use std::sync::Arc;
use yoto_avatar::render::FrameExposure;
use yoto_avatar::train::Validation;
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::{Shard, ShardBuilder};
use yoto_import::capture_dir::{CaptureOptions, DecodedCapture};

/// A capture that was read as an ingest job reads an upload.
#[derive(Debug, Clone)]
pub struct OneCamera {
    /// Name of the person.
    pub name: String,
    /// All of its frames.
    pub shard: Arc<Shard>,
}

impl OneCamera {
    /// Reads the whole capture at `path`; `on_frame` receives the number of frames so far, and of all frames. Videos of
    /// other kinds than H.264 need the program `ffmpeg`; without a path it is searched for.
    ///
    /// # Errors
    /// A capture that can't be read.
    pub fn read(
        path: &Path,
        ffmpeg: Option<&Path>,
        mut on_frame: impl FnMut(usize, usize),
    ) -> anyhow::Result<Self> {
        let decoded = DecodedCapture::open(path, &CaptureOptions::default(), ffmpeg)?;
        let frames = decoded.capture.track().frames.len();
        let shard = Arc::new(decoded.shard(|done| on_frame(done, frames))?);
        let name = decoded.name;
        Ok(Self { name, shard })
    }
}

/// The frames of a capture that are held out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HeldOut {
    /// One frame of each run of this length, as poses.
    Every(usize),
    /// One frame of each run of `every`, in place of views, and as poses the middle of each of `blocks` parts of
    /// the film, a tenth of the film in all: a frame whose neighbours are trained on tells less than one of a
    /// time that training never saw.
    EveryAndBlocks {
        /// Length of a run.
        every: usize,
        /// Number of blocks.
        blocks: usize,
    },
}

/// Share of a film that its blocks have together.
const BLOCKS: f64 = 0.1;

impl HeldOut {
    /// Where the frame at `position` of `frames`, with `index` in the track, is held out; `None` if it is trained on.
    fn of(self, position: usize, index: u32, frames: usize) -> Option<Split> {
        let (every, blocks) = match self {
            Self::Every(every) => {
                let held_out = Validation::Every(every).holds_out(position, index);
                return held_out.then_some(Split::NovelPose);
            }
            Self::EveryAndBlocks { every, blocks } => (every, blocks.max(1)),
        };
        let part = frames as f64 / blocks as f64;
        let along = (position as f64 + 0.5) / part;
        if (along.fract() - 0.5).abs() < BLOCKS / 2.0 {
            return Some(Split::NovelPose);
        }
        let held_out = Validation::Every(every).holds_out(position, index);
        held_out.then_some(Split::NovelView)
    }
}

/// The frames of the `film` that are held out become pictures of `size` pixels at their longest side, with the
/// poses of their frames in the track. The others are trained on.
pub(super) fn recording(
    film: &OneCamera,
    held_out: HeldOut,
    size: u32,
) -> anyhow::Result<Recording> {
    let OneCamera { name, shard } = film;
    let track = &shard.track;
    let frames = track.frames.len();
    let (mut kept, mut trained) = (track.clone(), Vec::new());
    let (mut novel_view, mut novel_pose) = (Vec::new(), Vec::new());
    kept.frames.clear();
    for (position, frame) in track.frames.iter().enumerate() {
        let pictures = match held_out.of(position, frame.index, frames) {
            None => {
                kept.frames.push(frame.clone());
                trained.push(position);
                continue;
            }
            Some(Split::NovelView) => &mut novel_view,
            Some(Split::NovelPose) => &mut novel_pose,
        };
        pictures.push(HeldOutPicture {
            label: format!("frame-{:06}", frame.index),
            given: Pose::from_frame(frame)?,
            pose: Pose::from_frame(frame)?,
            camera: Camera::from_frame(frame, track.image_size)?.scaled_to(size),
            truth: shard.image(position).resized(size),
            frame: Some(frame.index),
            exposure: FrameExposure::NEUTRAL,
        });
    }
    ensure!(
        !trained.is_empty() && !novel_pose.is_empty(),
        "{frames} frames are too few to hold some out"
    );
    let mut builder = ShardBuilder::new(kept);
    for position in trained {
        builder.push(&shard.image(position))?;
    }
    Ok(Recording {
        name: name.clone(),
        shard: Arc::new(builder.finish().context("packing the training frames")?),
        novel_view,
        novel_pose,
        actor: None,
        exact: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_synthetic::SyntheticPerson;

    fn film(frames: usize) -> OneCamera {
        let (track, images) = SyntheticPerson::cast(1, 7)[0].capture(frames, 32);
        let mut shard = ShardBuilder::new(track);
        for image in &images {
            shard.push(image).expect("fits");
        }
        OneCamera {
            name: "ada".into(),
            shard: Arc::new(shard.finish().expect("a shard")),
        }
    }

    #[test]
    fn held_out_frames_are_not_trained_on() {
        let film = film(9);
        let recording = recording(&film, HeldOut::Every(4), 16).expect("a recording");
        let number = |index: usize| film.shard.track.frames[index].index;
        let trained: Vec<u32> = (recording.shard.track.frames.iter())
            .map(|frame| frame.index)
            .collect();
        assert_eq!(trained, [0, 1, 3, 4, 5, 7, 8].map(number));
        assert_eq!(recording.shard.image(2), film.shard.image(3));
        let labels: Vec<&str> = recording.novel_pose.iter().map(|it| &*it.label).collect();
        assert_eq!(
            labels,
            [2, 6].map(|index| format!("frame-{:06}", number(index)))
        );
        assert_eq!(recording.novel_pose[0].truth.width, 16);
        assert_eq!(
            recording.novel_pose[0].truth,
            film.shard.image(2).resized(16)
        );
        assert!(recording.novel_view.is_empty());
    }

    #[test]
    fn a_film_needs_frames_to_train_on_and_to_hold_out() {
        let error = recording(&film(1), HeldOut::Every(4), 16).expect_err("none is held out");
        assert!(error.to_string().contains("too few"), "{error}");
    }

    #[test]
    fn blocks_are_apart_from_what_is_trained_on() {
        let held_out = HeldOut::EveryAndBlocks {
            every: 10,
            blocks: 2,
        };
        let splits: Vec<_> = (0..120).map(|at| held_out.of(at, at as u32, 120)).collect();
        let positions = |wanted: Split| -> Vec<usize> {
            (0..120).filter(|at| splits[*at] == Some(wanted)).collect()
        };
        let blocks: Vec<usize> = (27..=32).chain(87..=92).collect();
        assert_eq!(positions(Split::NovelPose), blocks);
        let every: Vec<usize> = (5..120).step_by(10).collect();
        assert_eq!(positions(Split::NovelView), every);
    }
}
