//! Synthetic people as recordings: filmed by one camera, known from every side, in clothes whose
//! motion is known.

use crate::captures::{HeldOutPicture, Recording};
use anyhow::Context;
use std::sync::Arc;
use yoto_avatar::render::FrameExposure;
use yoto_capture::ShardBuilder;
use yoto_capture::camera::{Camera, Pose};
use yoto_synthetic::SyntheticPerson;

/// Frames of a person's film.
const FRAMES: usize = 60;
/// Stride of the filmed poses that are held-out views, from cameras that did not film.
const VIEWED_EVERY: usize = 10;
/// Frames of the motion that is not filmed.
const UNSEEN: usize = 24;
/// Stride of its frames that are held-out poses.
const UNSEEN_EVERY: usize = 3;

/// `count` people at `size` pixels.
pub(crate) fn record(count: usize, size: u32, seed: u64) -> anyhow::Result<Vec<Recording>> {
    SyntheticPerson::cast(count, seed)
        .into_iter()
        .map(|person| recording(person, size))
        .collect()
}

/// The film of a person, with views and poses that it does not show.
fn recording(person: SyntheticPerson, size: u32) -> anyhow::Result<Recording> {
    let (track, film) = person.capture(FRAMES, size);
    let filmed = track.frames.iter().map(Pose::from_frame);
    let filmed = filmed.collect::<Result<Vec<Pose>, _>>()?;
    let mut shard = ShardBuilder::new(track);
    for image in &film {
        shard.push(image)?;
    }
    let shard = shard.finish().context("packing a synthetic capture")?;
    let view = |camera: &Camera, number: usize, pose: &Pose, frame: usize| HeldOutPicture {
        label: format!("cam{number:02}-{frame:06}"),
        given: pose.clone(),
        pose: pose.clone(),
        camera: camera.clone(),
        truth: person.render(pose, camera),
        frame: None,
        exposure: FrameExposure::NEUTRAL,
    };
    let cameras = SyntheticPerson::held_out_cameras(size);
    let seen_by = |poses: &[Pose], every: usize| -> Vec<HeldOutPicture> {
        let chosen: Vec<(usize, &Pose)> = poses.iter().enumerate().step_by(every).collect();
        (0..)
            .zip(&cameras)
            .flat_map(|(number, camera)| {
                let shown = chosen.iter();
                shown.map(move |(frame, pose)| (number, camera, *pose, *frame))
            })
            .map(|(number, camera, pose, frame)| view(camera, number, pose, frame))
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
