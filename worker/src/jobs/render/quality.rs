//! Choice of render settings for a requested quality, from the checkpoint's measured trade-off,
//! with predicted and actual figures.

use super::models::{Models, scene_view};
use crate::jobs::{JobContext, JobFailure};
use yoto_avatar::render::{RenderSettings, Renderer};
use yoto_avatar::tradeoff::{Choice, Curve, Want, choose};
use yoto_film::{Plan, View};
use yoto_proto::tiers;
use yoto_proto::v1::{RenderChoice, RenderQuality, render_quality};

/// Number of views whose rays are counted to predict the total time.
const COUNTED_VIEWS: usize = 16;

/// Chosen settings, and the source of their figures.
#[derive(Debug)]
pub(super) struct QualityChoice {
    choice: Choice,
    measured_on: String,
}

impl QualityChoice {
    /// Chooses the settings for `plan` from the curve of the checkpoint of the render's own model. Splats are drawn
    /// in real time as they are: for that goal they need no curve. Without a curve there is no choice then, nor for
    /// people of several models.
    pub(super) fn new(
        context: &JobContext,
        quality: &RenderQuality,
        models: &Models<'_>,
        plan: &Plan,
    ) -> Result<Option<Self>, JobFailure> {
        let (field, want) = want(quality)?;
        for model in models.all() {
            if let Some(message) = tiers::refusal(quality, &model.renderer.config().tier) {
                return Err(JobFailure::invalid("render", field, message));
            }
        }
        let (renderer, checkpoint) = (&models.own.renderer, &models.own.downloaded.checkpoint);
        if (models.several() || checkpoint.tradeoff.is_none()) && !tiers::needs_tradeoff(quality) {
            return Ok(None);
        }
        let object = checkpoint
            .tradeoff
            .as_ref()
            .ok_or_else(|| JobFailure::Failed {
                code: "NO_TRADEOFF",
                message: format!("no trade-off was measured with {}", checkpoint.name),
            })?;
        let json = context.get(object)??;
        let curve = Curve::from_json(&json)
            .map_err(|error| JobFailure::failed("TRADEOFF", &object.key, &error))?;
        let choice = choose(&curve, &want, mean_rays(renderer, &plan.views)?)
            .map_err(|error| JobFailure::invalid("render", field, error.to_string()))?;
        Ok(Some(Self {
            choice,
            measured_on: curve.machine.device,
        }))
    }

    /// Settings of the renderer.
    pub(super) fn settings(&self) -> &RenderSettings {
        &self.choice.settings
    }

    /// The predictions with the actual `seconds` per frame and PSNR of pictures with ground truth.
    pub(super) fn outcome(&self, seconds: f64, psnr: &[f64]) -> RenderChoice {
        let mean = psnr.iter().sum::<f64>() / psnr.len().max(1) as f64;
        RenderChoice {
            settings: Some((&self.choice.settings).into()),
            predicted_seconds_per_frame: self.choice.predicted_seconds,
            predicted_psnr: self.choice.predicted_psnr,
            predicted_psnr_to_full: self.choice.predicted_psnr_to_full,
            measured_on: self.measured_on.clone(),
            seconds_per_frame: seconds,
            psnr: (!psnr.is_empty()).then_some(mean),
            pictures_with_truth: psnr.len() as u32,
        }
    }
}

/// The goal, and its field.
fn want(quality: &RenderQuality) -> Result<(&'static str, Want), JobFailure> {
    match &quality.want {
        Some(render_quality::Want::MaxSecondsPerFrame(value)) => {
            Ok(("quality.max_seconds_per_frame", Want::MaxSeconds(*value)))
        }
        Some(render_quality::Want::MinPsnrDb(value)) => {
            Ok(("quality.min_psnr_db", Want::MinPsnr(*value)))
        }
        Some(render_quality::Want::Tier(name)) => Ok(("quality.tier", Want::Tier(name.clone()))),
        None => Err(JobFailure::invalid("render", "quality", "has no goal")),
    }
}

/// Mean number of rays through the bodies' boxes per view, over a sample of `views`.
fn mean_rays(renderer: &Renderer, views: &[View]) -> Result<f64, JobFailure> {
    let stride = views.len().div_ceil(COUNTED_VIEWS).max(1);
    let (mut sum, mut count) = (0, 0);
    for view in views.iter().step_by(stride) {
        sum += renderer
            .rays(&scene_view(view))
            .map_err(|error| JobFailure::failed("INTERNAL", "looking at a view", &error))?;
        count += 1;
    }
    Ok(sum as f64 / f64::from(count.max(1)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_avatar::config::Precision;

    #[test]
    fn the_outcome_stands_beside_the_prediction() {
        let choice = QualityChoice {
            choice: Choice {
                settings: RenderSettings {
                    samples: 32,
                    epsilon: 0.01,
                    min_transmittance: 0.05,
                    precision: Precision::Bf16,
                    scale: 0.5,
                    splats: 0.25,
                },
                predicted_seconds: 0.25,
                predicted_psnr: Some(30.0),
                predicted_psnr_to_full: 41.0,
            },
            measured_on: "a CPU".into(),
        };
        let known = choice.outcome(0.3, &[28.0, 32.0]);
        assert_eq!((known.psnr, known.pictures_with_truth), (Some(30.0), 2));
        assert_eq!(known.seconds_per_frame, 0.3);
        assert_eq!(known.predicted_seconds_per_frame, 0.25);
        let settings = known.settings.expect("says them");
        assert_eq!((settings.samples, settings.scale), (32, 0.5));
        assert_eq!(settings.splats, 0.25);
        assert!(settings.bf16 && settings.min_transmittance == 0.05);
        let unknown = choice.outcome(0.3, &[]);
        assert_eq!((unknown.psnr, unknown.pictures_with_truth), (None, 0));
        assert_eq!(unknown.predicted_psnr, Some(30.0));
    }

    #[test]
    fn a_goal_is_named_by_its_field() {
        let quality = |want| RenderQuality { want: Some(want) };
        let (field, goal) = want(&quality(render_quality::Want::MinPsnrDb(31.0))).expect("one");
        assert_eq!((field, goal), ("quality.min_psnr_db", Want::MinPsnr(31.0)));
        assert!(matches!(
            want(&RenderQuality { want: None }),
            Err(JobFailure::Invalid(_))
        ));
    }
}
