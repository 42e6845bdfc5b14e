//! Scores of held-out pictures after a fit of their poses alone: the difference that
//! remains once the model may stand where each picture shows the person.

use crate::captures::{Recording, Split};
use crate::display::Screen;
use crate::report::SplitScores;
use anyhow::Context;
use yoto_avatar::evaluate::{Examiner, Mean, Score, Truth};
use yoto_avatar::train::Trainer;
use yoto_proto::v1::Progress;

/// Means over all people, at most `count` pictures of each and of each split.
pub(super) fn scores(
    trainer: &Trainer,
    examiner: &Examiner,
    recordings: &[Recording],
    count: usize,
    screen: &dyn Screen,
) -> anyhow::Result<SplitScores> {
    let mut display = screen.begin("fitting");
    let mut done = 0;
    let mut mean = |split: Split| -> anyhow::Result<Score> {
        let mut mean = Mean::default();
        for (slot, recording) in recordings.iter().enumerate() {
            for view in recording.subset(split, count) {
                let pose = trainer
                    .fitted_pose(slot, &view.pose, &view.camera, &view.truth)
                    .with_context(|| format!("fitting the pose of {}", view.label))?;
                let truth = Truth {
                    pose: &pose,
                    camera: &view.camera,
                    image: &view.truth,
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
    display.finish(&format!("{done} fitted poses"));
    Ok(scores)
}
