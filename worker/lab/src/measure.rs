//! Renders held-out pictures and compares them with ground truth.

use crate::captures::{HeldOutPicture, Recording, Split};
use crate::display::Display;
use anyhow::Context;
use image::{GenericImage, RgbImage};
use std::path::Path;
use yoto_avatar::evaluate::{Examined, Examiner, Mean, Score, SplitScores, SubjectScore, Truth};
use yoto_media::picture_file;
use yoto_proto::v1::Progress;

/// Difference that is white in a map of errors, in units of the data range.
const WHITE: f32 = 0.25;

/// The mean over a fixed subset of each capture, at most `count` pictures of each, by a model
/// that has the recordings in its slots in their order, the first one in `first_slot`.
pub(super) fn subset(
    examiner: &Examiner,
    recordings: &[Recording],
    first_slot: usize,
    split: Split,
    count: usize,
) -> anyhow::Result<Score> {
    let mut mean = Mean::default();
    for (slot, recording) in (first_slot..).zip(recordings) {
        for view in recording.subset(split, count) {
            mean.add(&examine(examiner, slot, view)?.score);
        }
    }
    Ok(mean.score())
}

/// The mean over one person's pictures, at most `count` of them; `on_picture` receives the
/// seconds of each render.
pub(super) fn person(
    examiner: &Examiner,
    slot: usize,
    recording: &Recording,
    split: Split,
    count: usize,
    mut on_picture: impl FnMut(&HeldOutPicture, &Examined) -> anyhow::Result<()>,
) -> anyhow::Result<Score> {
    let mut mean = Mean::default();
    for view in recording.subset(split, count) {
        let examined = examine(examiner, slot, view)?;
        mean.add(&examined.score);
        on_picture(view, &examined)?;
    }
    Ok(mean.score())
}

/// One person's figures of both splits, at most `pictures` pictures of each, by a model that has
/// them in `slot`; each picture is written beside its render in the folder `pairs`.
pub(super) fn subject(
    examiner: &Examiner,
    slot: usize,
    recording: &Recording,
    pictures: usize,
    pairs: Option<&Path>,
    display: &mut dyn Display,
) -> anyhow::Result<SubjectScore> {
    let mut score = |split: Split| -> anyhow::Result<Score> {
        let of = recording.subset(split, pictures).count();
        let mut done = 0;
        person(examiner, slot, recording, split, pictures, |view, it| {
            if let Some(folder) = pairs {
                write_pair(folder, recording, split, view, it)?;
            }
            done += 1;
            display.progress(&Progress {
                phase: format!("{}, {}, {done} of {of}", recording.name, split.title()),
                fraction: done as f64 / of as f64,
                ..Progress::default()
            });
            Ok(())
        })
    };
    let (novel_view, novel_pose) = (score(Split::NovelView)?, score(Split::NovelPose)?);
    let scores = SplitScores {
        novel_view,
        novel_pose,
    };
    Ok(SubjectScore {
        name: recording.name.clone(),
        scores,
        black_image_psnr: scores.black_psnr(),
    })
}

fn examine(examiner: &Examiner, slot: usize, view: &HeldOutPicture) -> anyhow::Result<Examined> {
    let truth = Truth {
        pose: &view.pose,
        camera: &view.camera,
        image: &view.truth,
        exposure: view.exposure,
    };
    examiner
        .examine(slot, &truth)
        .with_context(|| format!("measuring {}", view.label))
}

/// Writes a picture, its render and a map of their difference side by side, as
/// `FOLDER/PERSON/SPLIT/LABEL.png`.
pub(super) fn write_pair(
    folder: &Path,
    recording: &Recording,
    split: Split,
    view: &HeldOutPicture,
    examined: &Examined,
) -> anyhow::Result<()> {
    let (width, height) = (view.truth.width, view.truth.height);
    let truth = picture_file::rgb(&view.label, width, height, &examined.truth)?;
    let render = picture_file::rgb(&view.label, width, height, &examined.render)?;
    let path = folder.join(&recording.name).join(split.folder());
    let file = path.join(&view.label).with_extension("png");
    let map = error_map(&truth, &render);
    Ok(picture_file::write(
        &file,
        &side_by_side(&[truth, render, map]),
    )?)
}

/// Pictures of one size.
fn side_by_side(pictures: &[RgbImage]) -> RgbImage {
    let (width, height) = pictures.first().map_or((0, 0), RgbImage::dimensions);
    let mut row = RgbImage::new(pictures.len() as u32 * width, height);
    for (x, picture) in (0..).step_by(width.max(1) as usize).zip(pictures) {
        let placed = row.copy_from(picture, x, 0);
        debug_assert!(
            placed.is_ok(),
            "the pictures were compared, so all have one size"
        );
    }
    row
}

/// The mean difference of the colours of each pixel, from black over red and yellow to white, which
/// is [`WHITE`] and more. The scale is the same in all maps, so that they can be compared.
fn error_map(truth: &RgbImage, render: &RgbImage) -> RgbImage {
    let mut map = truth.clone();
    for (pixel, rendered) in map.pixels_mut().zip(render.pixels()) {
        let apart = pixel.0.iter().zip(&rendered.0).map(|(a, b)| a.abs_diff(*b));
        let mean = apart.map(f32::from).sum::<f32>() / (3.0 * 255.0);
        let part = |from: f32| (255.0 * (3.0 * mean / WHITE - from)).clamp(0.0, 255.0) as u8;
        pixel.0 = [part(0.0), part(1.0), part(2.0)];
    }
    map
}
