//! Scores of held-out pictures at other poses than those that came with them.
//!
//! A fit of each pose removes errors of the poses from the score; an [`Alignment`] of all of them
//! removes the gauge of the model.

use crate::alignment::Alignment;
use crate::captures::{HeldOutPicture, Recording, Split};
use crate::display::Screen;
use anyhow::Context;
use yoto_avatar::evaluate::{Examiner, Mean, Score, SplitScores, Truth};
use yoto_avatar::train::Trainer;
use yoto_capture::camera::Pose;
use yoto_proto::v1::Progress;

/// Scores after a fit of each picture's pose: means over all people, the first one in `first_slot`, at most `count`
/// pictures per person and split.
pub(super) fn fitted(
    trainer: &Trainer,
    examiner: &Examiner,
    recordings: &[Recording],
    first_slot: usize,
    count: usize,
    screen: &dyn Screen,
) -> anyhow::Result<SplitScores> {
    scores(
        examiner,
        recordings,
        first_slot,
        count,
        screen,
        "fitting",
        |slot, it| {
            trainer
                .fitted_pose(slot, &it.pose, &it.camera, &it.truth)
                .with_context(|| format!("fitting the pose of {}", it.label))
        },
    )
}

/// Scores at the poses of each person moved by their alignment: the same means.
pub(super) fn aligned(
    alignments: &[Alignment],
    examiner: &Examiner,
    recordings: &[Recording],
    first_slot: usize,
    count: usize,
    screen: &dyn Screen,
) -> anyhow::Result<SplitScores> {
    let pose =
        |slot: usize, it: &HeldOutPicture| Ok(alignments[slot - first_slot].apply_to(&it.pose));
    scores(
        examiner,
        recordings,
        first_slot,
        count,
        screen,
        "aligned poses",
        pose,
    )
}

fn scores(
    examiner: &Examiner,
    recordings: &[Recording],
    first_slot: usize,
    count: usize,
    screen: &dyn Screen,
    title: &str,
    pose: impl Fn(usize, &HeldOutPicture) -> anyhow::Result<Pose>,
) -> anyhow::Result<SplitScores> {
    let mut display = screen.begin(title);
    let mut done = 0;
    let mut mean = |split: Split| -> anyhow::Result<Score> {
        let mut mean = Mean::default();
        for (slot, recording) in (first_slot..).zip(recordings) {
            for view in recording.subset(split, count) {
                let pose = pose(slot, view)?;
                let truth = Truth {
                    pose: &pose,
                    camera: &view.camera,
                    image: &view.truth,
                    exposure: view.exposure,
                };
                let examined = examiner
                    .examine(slot, &truth)
                    .with_context(|| format!("measuring {}", view.label))?;
                mean.add(&examined.score);
                done += 1;
                display.progress(&Progress {
                    phase: format!("{}, picture {done}", recording.name),
                    ..Progress::default()
                });
            }
        }
        Ok(mean.score())
    };
    let scores = SplitScores {
        novel_view: mean(Split::NovelView)?,
        novel_pose: mean(Split::NovelPose)?,
    };
    display.finish(&format!("{done} pictures"));
    Ok(scores)
}
