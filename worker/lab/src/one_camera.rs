//! Captures as users have them: one camera, and no pictures besides the film.

use crate::captures::{Recording, View};
use anyhow::{Context, ensure};
use std::sync::Arc;
use yoto_avatar::render::FrameExposure;
use yoto_avatar::train::Validation;
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::{Shard, ShardBuilder};

/// A capture that was read as an ingest job reads an upload.
#[derive(Debug, Clone)]
pub struct OneCamera {
    /// Name of the person.
    pub name: String,
    /// All of its frames.
    pub shard: Arc<Shard>,
}

/// Every `every`-th frame of the `film` becomes a held-out picture, `size` pixels at its longest
/// side, with the pose of its frame in the track. The others are trained on.
pub(super) fn recording(film: &OneCamera, every: usize, size: u32) -> anyhow::Result<Recording> {
    let OneCamera { name, shard } = film;
    let track = &shard.track;
    let validation = Validation::Every(every);
    let (mut kept, mut trained, mut pictures) = (track.clone(), Vec::new(), Vec::new());
    kept.frames.clear();
    for (index, frame) in track.frames.iter().enumerate() {
        if !validation.holds_out(index, frame.index) {
            kept.frames.push(frame.clone());
            trained.push(index);
            continue;
        }
        pictures.push(View {
            label: format!("frame-{:06}", frame.index),
            pose: Pose::from_frame(frame)?,
            camera: Camera::from_frame(frame, track.image_size)?.scaled_to(size),
            truth: shard.image(index).resized(size),
            frame: Some(frame.index),
            exposure: FrameExposure::NEUTRAL,
        });
    }
    ensure!(
        !trained.is_empty() && !pictures.is_empty(),
        "{} frames are too few to hold out one in {every}",
        track.frames.len()
    );
    let mut builder = ShardBuilder::new(kept);
    for index in trained {
        builder.push(&shard.image(index))?;
    }
    Ok(Recording {
        name: name.clone(),
        shard: Arc::new(builder.finish().context("packing the training frames")?),
        novel_view: Vec::new(),
        novel_pose: pictures,
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
        let recording = recording(&film, 4, 16).expect("a recording");
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
        let error = recording(&film(1), 4, 16).expect_err("none is held out");
        assert!(error.to_string().contains("too few"), "{error}");
    }
}
