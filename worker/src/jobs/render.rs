//! Renders pictures of one person: given views, an orbit around one pose, the motion of another
//! person, or a motion from a file.

mod clip;
mod follow;
mod motion;
mod orbit;
mod quality;
mod request;
mod truth;
mod views;

use super::checkpoint::Downloaded;
use super::{JobContext, JobFailure, checkpoint, shard};
use crate::media::{
    Pixels,
    animation::{Animation, MAX_FPS},
    picture,
};
use quality::Promise;
use request::Request;
use std::time::{Duration, Instant};
use truth::Truths;
use yoto_avatar::render::{RenderError, RenderView, Rendered, Renderer};
use yoto_proto::{
    keys, names,
    v1::{Inputs, RenderResult, RenderSpec, RenderedFile, render_spec::What},
};

/// Name of the animated file.
const ANIMATION: &str = "animation.png";
/// Frames per second of an animation that has no speed of its own.
const FPS: f32 = 15.0;

/// Renders all views of the request.
///
/// # Errors
/// Bad requests, a model without a complete checkpoint, and faults of the store.
pub fn run(
    context: &JobContext,
    spec: &RenderSpec,
    inputs: &Inputs,
) -> Result<RenderResult, JobFailure> {
    let request = Request::new(spec, inputs)?;
    let (mut renderer, found) = checkpoint::load_renderer(context, inputs, "render")?;
    let scene = expand(context, &request, &renderer, &found, inputs)?;
    let promise = match &spec.quality {
        Some(quality) => {
            let promise =
                Promise::make(context, quality, &found.checkpoint, &renderer, &scene.views)?;
            renderer
                .set(promise.settings())
                .map_err(|error| JobFailure::failed("TRADEOFF", "the chosen settings", &error))?;
            Some(promise)
        }
        None => None,
    };
    let drawn = draw(context, &request, &renderer, &scene)?;
    Ok(RenderResult {
        choice: promise.map(|promise| promise.came_true(drawn.seconds_per_frame, &drawn.psnr)),
        files: drawn.files,
        seconds_per_frame: drawn.seconds_per_frame,
        device: context.device.info.adapter.clone(),
        checkpoint: names::checkpoint(&spec.model, found.manifest.step),
        fps: scene.fps,
    })
}

/// Everything that a request asks to see.
struct Scene {
    views: Vec<RenderView>,
    /// The ground truth, if known.
    truths: Truths,
    /// Frames per second of the animation.
    fps: f32,
}

/// What the request asks to see.
fn expand(
    context: &JobContext,
    request: &Request<'_>,
    renderer: &Renderer,
    found: &Downloaded,
    inputs: &Inputs,
) -> Result<Scene, JobFailure> {
    let skeleton = renderer
        .skeleton(request.slot)
        .ok_or_else(|| JobFailure::Failed {
            code: "NO_CHECKPOINT",
            message: format!(
                "{} does not know {}: it was trained before they joined the model",
                found.checkpoint.name,
                shard::person(inputs, &request.spec.subject)
            ),
        })?;
    let stage = views::Stage {
        slot: request.slot,
        background: request.background,
        joints: skeleton.parents.len(),
    };
    let still = request.fps.unwrap_or(FPS);
    let views = match request.what {
        What::Views(list) => stage.listed(list)?,
        What::Orbit(orbit) => {
            let subject = &request.spec.subject;
            let (_, shard) = shard::with_refined_poses(context, inputs, found, subject)?;
            orbit::views(&stage, orbit, &shard.track)?
        }
        What::Clip(clip) => {
            let subject = &request.spec.subject;
            let (_, shard) = shard::with_refined_poses(context, inputs, found, subject)?;
            clip::views(&stage, clip, &shard.track, skeleton)?
        }
        What::Motion(transfer) => {
            let driver = &transfer.driver;
            let (_, shard) = shard::with_refined_poses(context, inputs, found, driver)?;
            let places = motion::places(transfer, &shard.track)?;
            let natural = motion::natural_fps(&places, &shard.track);
            return Ok(Scene {
                fps: request.fps.or(natural).unwrap_or(FPS).min(MAX_FPS),
                views: motion::views(&stage, transfer, &places, &shard.track, skeleton)?,
                truths: Truths::of_motion(request, transfer, shard, skeleton)?,
            });
        }
    };
    Ok(Scene {
        views,
        truths: Truths::none(),
        fps: still,
    })
}

/// Result of rendering all views.
struct Drawn {
    files: Vec<RenderedFile>,
    seconds_per_frame: f64,
    /// dB, of each picture with ground truth.
    psnr: Vec<f64>,
}

/// Renders and stores each view, and the animation of all of them if requested.
fn draw(
    context: &JobContext,
    request: &Request<'_>,
    renderer: &Renderer,
    scene: &Scene,
) -> Result<Drawn, JobFailure> {
    let Scene { views, truths, fps } = scene;
    let job = context.job_id()?;
    let store = |file: String, bytes| {
        let object = context.put(&keys::render(job, context.token, &file), bytes)?;
        Ok::<_, JobFailure>(RenderedFile {
            file,
            object: Some(object),
        })
    };
    let kind = match request.spec.transparent {
        true => Pixels::Rgba,
        false => Pixels::Rgb,
    };
    let mut animated = Vec::new();
    let mut animation = match views.first() {
        Some(first) if request.spec.animate => {
            request::same_size(views)?;
            let size = (first.camera.width, first.camera.height);
            let count = views.len() as u32;
            Some(Animation::new(&mut animated, kind, size, count, *fps)?)
        }
        _ => None,
    };
    let (mut rendered, mut psnr) = (Vec::new(), Vec::new());
    let mut spent = Duration::ZERO;
    for (done, view) in views.iter().enumerate() {
        context.check()?;
        context.report_pieces("rendering", done, views.len());
        let began = Instant::now();
        let image = frame(context, renderer, view, done)?;
        let pixels = match kind {
            Pixels::Rgb => image.to_rgb8(),
            Pixels::Rgba => image.to_rgba8(),
        };
        spent += began.elapsed();
        psnr.extend(truths.psnr(done, view, &image.to_rgb8()));
        if let Some(animation) = &mut animation {
            animation.push(&pixels)?;
        }
        let (width, height) = (view.camera.width, view.camera.height);
        rendered.push(store(
            format!("{done:06}.png"),
            picture::png(kind, width, height, &pixels)?,
        )?);
    }
    if animation.map(Animation::finish).transpose()?.is_some() {
        rendered.push(store(ANIMATION.into(), animated)?);
    }
    context.report_pieces("rendering", views.len(), views.len());
    Ok(Drawn {
        files: rendered,
        seconds_per_frame: spent.as_secs_f64() / views.len().max(1) as f64,
        psnr,
    })
}

/// View number `place`, unless the job must stop before it is finished.
fn frame(
    context: &JobContext,
    renderer: &Renderer,
    view: &RenderView,
    place: usize,
) -> Result<Rendered, JobFailure> {
    let rendered = renderer.render_while(view, &mut |_| context.check().is_ok());
    rendered.or_else(|error| {
        if matches!(error, RenderError::Stopped) {
            context.check()?;
        }
        let place = format!("rendering view {place}");
        Err(JobFailure::failed("INTERNAL", &place, &error))
    })
}
