//! The demo's figures: downloaded renders against ground truth.

use super::people::{Actor, HeldOut};
use super::render::HeldOutRenders;
use super::report::{DemoReport, Settings};
use anyhow::Context;
use image::RgbImage;
use yoto_avatar::evaluate::{Mean, Score, SplitScores, SubjectScore, compare};
use yoto_proto::v1::TrainResult;

/// Each actor's figures.
pub(super) fn subjects(
    actors: &[Actor],
    renders: &[HeldOutRenders],
) -> anyhow::Result<Vec<SubjectScore>> {
    let subject = |(actor, renders): (&Actor, &HeldOutRenders)| {
        let novel_view = split(&actor.name, &actor.novel_view, &renders.novel_view)?;
        let novel_pose = split(&actor.name, &actor.novel_pose, &renders.novel_pose)?;
        Ok(SubjectScore {
            name: actor.name.clone(),
            scores: SplitScores {
                novel_view,
                novel_pose,
            },
            black_image_psnr: novel_view.black_psnr,
        })
    };
    actors.iter().zip(renders).map(subject).collect()
}

fn split(name: &str, views: &[HeldOut], renders: &[RgbImage]) -> anyhow::Result<Score> {
    let mut mean = Mean::default();
    for (index, (view, render)) in views.iter().zip(renders).enumerate() {
        let size = (render.width() as usize, render.height() as usize);
        let score = compare(&view.truth, render.as_raw(), size)
            .with_context(|| format!("view {index} of {name}"))?;
        mean.add(&score);
    }
    Ok(mean.score())
}

/// Figures and costs.
pub(super) fn report(
    subjects: Vec<SubjectScore>,
    renders: &[HeldOutRenders],
    trained: TrainResult,
    settings: Settings,
) -> DemoReport {
    let seconds: f64 = renders.iter().map(|render| render.seconds_per_frame).sum();
    DemoReport {
        mean: SplitScores::mean(&subjects),
        subjects,
        steps: trained.steps,
        train_seconds: trained.train_seconds,
        steps_per_second: trained.steps as f64 / trained.train_seconds.max(f64::EPSILON),
        parameters: trained.parameters,
        checkpoint_bytes: trained.checkpoint_bytes,
        device: trained.device,
        objective: trained.objective,
        active_parts: trained.active_parts,
        notes: trained.notes,
        render_seconds_per_frame: seconds / renders.len().max(1) as f64,
        settings,
    }
}
