//! Time and fidelity of render settings with one checkpoint, measured on held-out frames.

use super::Pictures;
use crate::jobs::context::id;
use crate::jobs::{JobContext, JobFailure};
use std::time::{SystemTime, UNIX_EPOCH};
use yoto_avatar::render::{RenderView, Renderer};
use yoto_avatar::tradeoff::{Axes, Curve, SweepError, SweepOptions, SweepView, sweep};
use yoto_proto::keys;
use yoto_proto::names::Collection;
use yoto_proto::v1::{ObjectRef, TradeoffSpec};

/// Default number of held-out frames to render with each setting.
const VIEWS: usize = 4;
/// Default number of timed renders of each frame.
const REPEATS: usize = 3;

/// A sweep over the settings around the model's own.
pub(super) struct Sweep {
    options: SweepOptions,
    views: Vec<SweepView>,
}

impl Sweep {
    /// The `wanted` sweep with `renderer` over held-out frames of `people`.
    pub(super) fn new(
        context: &JobContext,
        renderer: &Renderer,
        wanted: &TradeoffSpec,
        people: &[Pictures],
    ) -> Self {
        let or = |asked: u32, default| match asked {
            0 => default,
            asked => asked as usize,
        };
        let options = SweepOptions {
            settings: Axes::of(renderer).settings(),
            repeats: or(wanted.repeats, REPEATS),
            machine: context.device.machine(),
            unix_seconds: SystemTime::now()
                .duration_since(UNIX_EPOCH)
                .map_or(0, |since| since.as_secs()),
        };
        Self {
            views: views(people, or(wanted.views, VIEWS)),
            options,
        }
    }

    /// Number of frames that it renders.
    pub(super) fn frames(&self) -> usize {
        self.options.frames(self.views.len())
    }

    /// Measures; the job has rendered `before` frames already.
    pub(super) fn measure(
        &self,
        context: &JobContext,
        mut renderer: Renderer,
        before: usize,
    ) -> Result<Curve, JobFailure> {
        sweep(&mut renderer, &self.views, &self.options, |done, total| {
            context.check()?;
            context.report_pieces("measuring the trade-off", before + done, before + total);
            Ok(())
        })
    }
}

/// `wanted` held-out frames, spread out, from all subjects in turn.
fn views(people: &[Pictures], wanted: usize) -> Vec<SweepView> {
    let all: Vec<SweepView> = people
        .iter()
        .flat_map(|person| {
            person.frames.iter().map(|picture| SweepView {
                view: RenderView {
                    slot: person.slot,
                    pose: picture.pose.clone(),
                    camera: picture.camera.clone(),
                    background: [0.0; 3],
                },
                truth: Some(picture.image.rgb.clone()),
            })
        })
        .collect();
    let count = wanted.min(all.len());
    (0..count)
        .map(|i| all[i * all.len() / count].clone())
        .collect()
}

/// Stores the curve beside its checkpoint.
pub(super) fn keep(
    context: &JobContext,
    model: &str,
    step: u64,
    curve: &Curve,
) -> Result<ObjectRef, JobFailure> {
    let model_id = id(Collection::Models, model)?;
    let key = keys::tradeoff(model_id, context.job_id()?, context.claim.token, step);
    let json = curve
        .to_json()
        .map_err(|error| JobFailure::failed("INTERNAL", "storing the trade-off", &error))?;
    context.put(&key, json)
}

impl From<SweepError> for JobFailure {
    fn from(error: SweepError) -> Self {
        Self::failed("EVALUATION", "measuring the trade-off", &error)
    }
}
