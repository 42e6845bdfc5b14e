//! Renders pictures of one person (given views, an orbit around one pose, the motion of another
//! person, or a motion from a file) or of several people in a scene.
//!
//! ```text
//! request ─► models ─► captures ─► yoto_film::plan ─► quality ─► draw
//! (checks)   └─── downloads ───┘   (pure)                        (with other workers)
//! ```

mod backdrop;
mod captures;
mod committed;
mod draw;
mod layers;
mod models;
mod picture;
mod quality;
mod request;
mod share;
mod surroundings;
mod unfilmed;

use super::{JobContext, JobFailure};
use models::Models;
use picture::PictureRenderer;
use quality::QualityChoice;
use request::Request;
use yoto_film::{needs, plan};
use yoto_proto::v1::{RenderResult, RenderSpec};
use yoto_proto::worker::v1::Inputs;

/// Renders all views of the request, or those that are left to a lease that `helps`.
///
/// # Errors
/// Bad requests, a model without a complete checkpoint, and faults of the store.
pub fn run(
    context: &JobContext,
    spec: &RenderSpec,
    inputs: &Inputs,
    helps: bool,
) -> Result<RenderResult, JobFailure> {
    let request = Request::new(spec, inputs)?;
    let mut models = Models::load(context, &request, inputs)?;
    let bodies = models.bodies(&request, inputs);
    let captures = captures::fetch(context, inputs, &models, &needs(spec, &bodies))?;
    let mut plan = plan(spec, &bodies, &captures)?;
    backdrop::add(context, spec, &mut plan)?;
    let choice = match &spec.quality {
        Some(quality) => QualityChoice::new(context, quality, &models, &plan)?,
        None => None,
    };
    if let Some(choice) = &choice {
        models.set(choice.settings())?;
    }
    models.prepare(&plan.views)?;
    let renderer = PictureRenderer::new(context, spec, &plan, &models);
    let drawn = draw::draw(&renderer, inputs, helps)?;
    let depth = plan.layer.range();
    let mut checkpoints = models.all().map(|model| model.checkpoint());
    Ok(RenderResult {
        depth_near: depth.map(|it| it[0]),
        depth_far: depth.map(|it| it[1]),
        choice: choice.map(|choice| choice.outcome(drawn.seconds_per_frame, &drawn.psnr)),
        files: drawn.files,
        seconds_per_frame: drawn.seconds_per_frame,
        device: context.device.info.adapter.clone(),
        checkpoint: checkpoints.next().unwrap_or_default(),
        other_checkpoints: checkpoints.collect(),
        fps: plan.fps,
    })
}
