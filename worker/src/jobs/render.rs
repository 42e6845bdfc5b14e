//! Renders pictures of one person (given views, an orbit around one pose, the motion of another
//! person, or a motion from a file) or of several people in a scene.

mod between;
mod cast;
mod clip;
mod committed;
mod follow;
mod layers;
mod level;
mod models;
mod motion;
mod orbit;
mod quality;
mod request;
mod scene;
mod share;
mod surroundings;
mod truth;
mod views;

use super::{JobContext, JobFailure};
use crate::media::{
    Pixels,
    animation::{Animation, MAX_FPS},
    picture,
};
use between::Made;
use cast::{Cast, bearings};
use committed::Committed;
use layers::Shown;
use models::{Loaded, Models, PaintedBy, Troupe};
use quality::Promise;
use request::Request;
use std::time::{Duration, Instant};
use surroundings::Surroundings;
use truth::{Truths, beside};
use yoto_avatar::{
    render::{Light, RenderError, RenderView, Rendered, SceneView},
    tradeoff::sweep::fidelity,
};
use yoto_proto::{
    keys,
    v1::{Inputs, Layer, RenderResult, RenderSpec, RenderedFile, render_spec::What},
};

/// Name of the animated file.
const ANIMATION: &str = "animation.png";
/// Frames per second of an animation that has no speed of its own.
const FPS: f32 = 15.0;

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
    let mut models = Models::load(context, spec, inputs)?;
    let mut made = Vec::new();
    if let Some(between) = &spec.between {
        (models.own.renderer, made) = between::add(models.own.renderer, &request, between)?;
    } else if !spec.bones.is_empty() {
        (models.own.renderer, made) =
            between::on_bones(models.own.renderer, &request, &spec.bones)?;
    }
    let film = {
        let cast = |model| Cast::new(context, &request, model, inputs);
        let others: Vec<Cast<'_>> = models.others.iter().map(cast).collect();
        expand(&cast(&models.own), &others, &made)?
    };
    let promise = match &spec.quality {
        Some(quality) => Promise::make(context, quality, &models, &film.views)?,
        None => None,
    };
    if let Some(promise) = &promise {
        (models.own.renderer.set(promise.settings()))
            .map_err(|error| JobFailure::failed("TRADEOFF", "the chosen settings", &error))?;
    }
    let troupe = Troupe {
        models: &models,
        by: &film.models,
    };
    let layer = Layer::try_from(spec.layer).unwrap_or_default();
    let shown = Shown::new(layer, troupe, &film.views);
    let painter = Painter {
        context,
        request: &request,
        troupe,
        film: &film,
        shown: &shown,
    };
    let drawn = draw(&painter, inputs, helps)?;
    let [depth_near, depth_far] = shown.range();
    Ok(RenderResult {
        depth_near,
        depth_far,
        choice: promise.map(|promise| promise.came_true(drawn.seconds_per_frame, &drawn.psnr)),
        files: drawn.files,
        seconds_per_frame: drawn.seconds_per_frame,
        device: context.device.info.adapter.clone(),
        checkpoint: models.own.checkpoint(),
        other_checkpoints: models.others.iter().map(Loaded::checkpoint).collect(),
        fps: film.fps,
    })
}

/// Everything that a request asks to see.
struct Film {
    views: Vec<SceneView>,
    /// As [`Troupe::by`].
    models: PaintedBy,
    /// What is behind the people, other than the views' own colour.
    surroundings: Option<Surroundings>,
    /// The ground truth, if known.
    truths: Truths,
    /// Frames per second of the animation.
    fps: f32,
}

/// What the request asks to see, by its own model's `cast` and those of `others`, with those who were `made` for
/// it in place of its subject.
fn expand(cast: &Cast<'_>, others: &[Cast<'_>], made: &[Made]) -> Result<Film, JobFailure> {
    match cast.request.what {
        What::Scene(scene) => scene::film(cast, others, scene),
        what if made.is_empty() => of_one(cast, what, None),
        what => between::film(cast, what, made),
    }
}

/// Pictures of the request's subject, or of the identity in `slot` in their place.
fn of_one(cast: &Cast<'_>, what: &What, slot: Option<usize>) -> Result<Film, JobFailure> {
    let request = cast.request;
    let subject = &request.spec.subject;
    let own = cast.body(subject)?;
    let skeleton = slot.and_then(|slot| cast.renderer.skeleton(slot));
    let skeleton = skeleton.unwrap_or(own);
    let stage = views::Stage {
        slot: slot.map_or_else(|| cast.slot(subject), Ok)?,
        background: request.background,
        joints: skeleton.parents.len(),
    };
    // The pictures are in the world of the subject's capture, except with somebody else's motion.
    let mut world = subject;
    let (mut fps, mut truths) = (request.fps.unwrap_or(FPS), Truths::none());
    let views = match what {
        What::Views(list) => stage.listed(list)?,
        What::Orbit(orbit) => orbit::views(&stage, orbit, &*cast.track(subject)?)?,
        What::Clip(clip) => {
            clip::views(&stage, clip, &*cast.track(subject)?, skeleton, fps.into())?
        }
        What::Motion(transfer) => {
            world = &transfer.driver;
            let shard = cast.shard(world)?;
            let places = motion::places(transfer, &shard.track, "motion")?;
            let natural = motion::natural_fps(&places, &shard.track);
            fps = request.fps.or(natural).unwrap_or(FPS).min(MAX_FPS);
            let views = motion::views(&stage, transfer, &places, &shard.track, skeleton)?;
            truths = Truths::of_motion(request, transfer, shard, skeleton)?;
            views
        }
        What::Scene(_) => return Err(JobFailure::invalid("render", "scene", "not of one person")),
    };
    let light = match &request.spec.light {
        None if world == subject || !cast.renderer.has_light() => Light::Own,
        None => cast.of(subject, &bearings(&*cast.track(world)?)?)?,
        wanted => {
            let world = bearings(&*cast.track(world)?)?;
            cast.wanted(wanted.as_ref(), "light", &world)?
                .unwrap_or_default()
        }
    };
    Ok(Film {
        views: views.into_iter().map(|view| lit(view, light)).collect(),
        models: Vec::new(),
        surroundings: None,
        truths,
        fps,
    })
}

fn lit(view: RenderView, light: Light) -> SceneView {
    let mut view = SceneView::from(view);
    for actor in &mut view.actors {
        actor.light = light;
    }
    view
}

/// Result of rendering all views.
struct Drawn {
    files: Vec<RenderedFile>,
    seconds_per_frame: f64,
    /// dB, of each picture with ground truth.
    psnr: Vec<f64>,
}

/// Renders and commits the views that this lease gets, and the animation of all of them if requested. Seconds
/// and PSNR are of the views of this lease.
fn draw(painter: &Painter<'_>, inputs: &Inputs, helps: bool) -> Result<Drawn, JobFailure> {
    let context = painter.context;
    let views = &painter.film.views;
    let kind = painter.kind();
    let mut animated = Vec::new();
    let mut animation = match views.first() {
        Some(first) if painter.request.spec.animate && !helps => {
            request::same_size(views)?;
            let (count, fps) = (views.len() as u32, painter.film.fps);
            let size = painter.size(first);
            Some(Animation::new(&mut animated, kind, size, count, fps)?)
        }
        _ => None,
    };
    let mut committed = Committed::new(context, inputs);
    let (mut psnr, mut spent, mut drawn) = (Vec::new(), Duration::ZERO, 0);
    // The pixels of a view that an earlier lease has drawn, or this one does.
    let mut pixels_of = |place: usize, committed: &mut Committed<'_>| -> Result<_, JobFailure> {
        let file = keys::picture(place as u32);
        if let Some(pixels) = committed.take_over(&file, kind)? {
            return Ok(pixels);
        }
        let painted = painter.paint(place)?;
        (spent, drawn) = (spent + painted.time, drawn + 1);
        psnr.extend(painted.psnr);
        let (width, height) = painter.size(&views[place]);
        committed.add(file, picture::png(kind, width, height, &painted.pixels)?)?;
        Ok(painted.pixels)
    };
    share::draw(
        context,
        views.len(),
        helps,
        &mut committed,
        &mut |place, files| pixels_of(place, files).map(drop),
    )?;
    // All pictures are there, unless the service knows no ranges, or one is damaged.
    for place in (0..views.len()).filter(|_| !helps) {
        context.check()?;
        if animation.is_none() && committed.is_sound(&keys::picture(place as u32)) {
            continue;
        }
        let pixels = pixels_of(place, &mut committed)?;
        if let Some(animation) = &mut animation {
            animation.push(&pixels)?;
        }
    }
    if animation.map(Animation::finish).transpose()?.is_some() {
        committed.add(ANIMATION.into(), animated)?;
    }
    if !helps {
        context.report_pieces("rendering", views.len(), views.len());
    }
    Ok(Drawn {
        files: committed.into_files(),
        seconds_per_frame: spent.as_secs_f64() / f64::from(drawn.max(1)),
        psnr,
    })
}

/// Draws views of a film.
struct Painter<'a> {
    context: &'a JobContext,
    request: &'a Request<'a>,
    troupe: Troupe<'a>,
    film: &'a Film,
    shown: &'a Shown,
}

/// A drawn view.
struct Painted {
    pixels: Vec<u8>,
    time: Duration,
    /// dB, if there is ground truth.
    psnr: Option<f64>,
}

impl Painter<'_> {
    /// What a pixel of the pictures has.
    fn kind(&self) -> Pixels {
        match self.request.spec.transparent {
            true => Pixels::Rgba,
            false => Pixels::Rgb,
        }
    }

    /// Width and height of the picture of `view`.
    fn size(&self, view: &SceneView) -> (u32, u32) {
        let pictures = if self.request.spec.compare { 2 } else { 1 };
        (view.camera.width * pictures, view.camera.height)
    }

    /// Draws view number `place`.
    fn paint(&self, place: usize) -> Result<Painted, JobFailure> {
        let (context, troupe, film) = (self.context, self.troupe, self.film);
        let view = &film.views[place];
        let compare = self.request.spec.compare;
        let size = (view.camera.width, view.camera.height);
        let filmed = film.truths.picture(place, size);
        if compare && filmed.is_none() {
            return Err(not_filmed(place));
        }
        let began = Instant::now();
        let mut image = frame(context, troupe, view, place)?;
        if let Some(surroundings) = &film.surroundings {
            let above = |view: &SceneView| frame(context, troupe, view, place);
            let shadow = surroundings.shadow(troupe, view, above)?;
            surroundings.behind(&mut image, shadow.as_ref(), &view.camera);
        }
        let mut pixels = match self.kind() {
            Pixels::Rgb => self.shown.rgb8(&image),
            Pixels::Rgba => image.to_rgba8(),
        };
        let time = began.elapsed();
        let mut psnr = None;
        if let Some(filmed) = filmed {
            psnr = Some(fidelity(&filmed, &image.to_rgb8()));
            if compare {
                pixels = beside(&filmed, &pixels, view.camera.width);
            }
        }
        Ok(Painted { pixels, time, psnr })
    }
}

/// View number `place` has no filmed picture to compare it with.
fn not_filmed(place: usize) -> JobFailure {
    let message = format!(
        "view {place} was not filmed: only a person's own motion over black, in their own light, with their \
         capture's camera and at most its size"
    );
    JobFailure::invalid("render", "compare", message)
}

/// View number `place`, unless the job must stop before it is finished.
fn frame(
    context: &JobContext,
    troupe: Troupe<'_>,
    view: &SceneView,
    place: usize,
) -> Result<Rendered, JobFailure> {
    let rendered = troupe.draw(view, &mut |_| context.check().is_ok());
    rendered.or_else(|error| {
        if matches!(error, RenderError::Stopped) {
            context.check()?;
        }
        let place = format!("rendering view {place}");
        Err(JobFailure::failed("INTERNAL", &place, &error))
    })
}
