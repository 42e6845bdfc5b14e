//! Synthetic people as recordings: filmed by one camera, known from every side, in clothes whose
//! motion is known.

use crate::captures::{Recording, View};
use anyhow::Context;
use std::sync::Arc;
use yoto_avatar::render::FrameExposure;
use yoto_capture::ShardBuilder;
use yoto_capture::camera::{Camera, Pose};
use yoto_synthetic::SyntheticPerson;

/// Frames of a person's film.
pub(crate) const FRAMES: usize = 60;
/// Filmed poses that are looked at from cameras that did not film: every so many-th.
const VIEWED_EVERY: usize = 10;
/// Frames of the motion that is not filmed.
const UNSEEN: usize = 24;
/// Those that are looked at: every so many-th.
const UNSEEN_EVERY: usize = 3;

/// `count` people at `size` pixels.
pub(crate) fn record(count: usize, size: u32, seed: u64) -> anyhow::Result<Vec<Recording>> {
    SyntheticPerson::cast(count, seed)
        .into_iter()
        .map(|person| recording(person, FRAMES, size))
        .collect()
}

/// A person filmed for so many `frames`.
fn recording(person: SyntheticPerson, frames: usize, size: u32) -> anyhow::Result<Recording> {
    let (track, film) = person.capture(frames, size);
    let filmed = track.frames.iter().map(Pose::from_frame);
    let filmed = filmed.collect::<Result<Vec<Pose>, _>>()?;
    let mut shard = ShardBuilder::new(track);
    for image in &film {
        shard.push(image)?;
    }
    let shard = shard.finish().context("packing a synthetic capture")?;
    let view = |camera: &Camera, at: usize, pose: &Pose, frame: usize| View {
        label: format!("cam{at:02}-{frame:06}"),
        pose: pose.clone(),
        camera: camera.clone(),
        truth: person.render(pose, camera),
        frame: None,
        exposure: FrameExposure::NEUTRAL,
    };
    let cameras = SyntheticPerson::held_out_cameras(size);
    let seen_by = |poses: &[Pose], every: usize| -> Vec<View> {
        let chosen: Vec<(usize, &Pose)> = poses.iter().enumerate().step_by(every).collect();
        (0..)
            .zip(&cameras)
            .flat_map(|(at, camera)| {
                let shown = chosen.iter();
                shown.map(move |(frame, pose)| (at, camera, *pose, *frame))
            })
            .map(|(at, camera, pose, frame)| view(camera, at, pose, frame))
            .collect()
    };
    let novel_view = seen_by(&filmed, VIEWED_EVERY);
    let novel_pose = seen_by(&person.unseen_motion(UNSEEN), UNSEEN_EVERY);
    Ok(Recording {
        name: person.name().to_owned(),
        shard: Arc::new(shard),
        novel_view,
        novel_pose,
        actor: Some(person),
        exact: None,
    })
}
