//! Draws and commits all pictures of a plan, with those that other workers draw, and their animation.

use super::committed::Committed;
use super::picture::PictureRenderer;
use super::share::draw_ranges;
use crate::jobs::JobFailure;
use std::time::Duration;
use yoto_film::View;
use yoto_media::png::{self, Animation};
use yoto_proto::keys;
use yoto_proto::v1::RenderedFile;
use yoto_proto::worker::v1::Inputs;

/// Name of the animated file.
const ANIMATION: &str = "animation.png";

// A plan's speed is one that an animation can have.
const _: () = assert!(yoto_film::MAX_FPS <= png::MAX_FPS);

/// Result of drawing all pictures.
pub(super) struct Drawn {
    pub(super) files: Vec<RenderedFile>,
    /// Of the pictures that this lease drew.
    pub(super) seconds_per_frame: f64,
    /// dB, of each picture with ground truth that this lease drew.
    pub(super) psnr: Vec<f64>,
}

/// Draws and commits the pictures that this lease gets, and the animation of all of them if requested, unless it
/// only `helps`.
pub(super) fn draw(
    renderer: &PictureRenderer<'_>,
    inputs: &Inputs,
    helps: bool,
) -> Result<Drawn, JobFailure> {
    let context = renderer.context;
    let views = &renderer.plan.views;
    let kind = renderer.kind();
    let mut animated = Vec::new();
    let mut animation = match views.first() {
        Some(first) if renderer.spec.animate && !helps => {
            check_same_size(views)?;
            let (count, fps) = (views.len() as u32, renderer.plan.fps);
            let size = renderer.size(first);
            Some(Animation::new(&mut animated, kind, size, count, fps)?)
        }
        _ => None,
    };
    let mut committed = Committed::new(context, inputs);
    let (mut psnr, mut spent, mut drawn) = (Vec::new(), Duration::ZERO, 0);
    // The pixels of a picture that an earlier lease has drawn, or this one does.
    let mut pixels_of = |index: usize, committed: &mut Committed<'_>| -> Result<_, JobFailure> {
        let file = keys::picture(index as u32);
        if let Some(pixels) = committed.take_over(&file, kind)? {
            return Ok(pixels);
        }
        let picture = renderer.draw(index)?;
        (spent, drawn) = (spent + picture.time, drawn + 1);
        psnr.extend(picture.psnr);
        let (width, height) = renderer.size(&views[index]);
        committed.add(file, png::encode(kind, width, height, &picture.pixels)?)?;
        Ok(picture.pixels)
    };
    draw_ranges(
        context,
        views.len(),
        helps,
        &mut committed,
        &mut |index, files| pixels_of(index, files).map(drop),
    )?;
    // All pictures are there, unless the service knows no ranges, or one is damaged.
    for index in (0..views.len()).filter(|_| !helps) {
        context.check()?;
        if animation.is_none() && committed.is_sound(&keys::picture(index as u32)) {
            continue;
        }
        let pixels = pixels_of(index, &mut committed)?;
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

/// An animation has one size.
fn check_same_size(views: &[View]) -> Result<(), JobFailure> {
    let size = |view: &View| (view.camera.width, view.camera.height);
    match views.iter().position(|view| size(view) != size(&views[0])) {
        None => Ok(()),
        Some(odd) => Err(JobFailure::invalid(
            "render",
            &format!("views[{odd}].camera"),
            "every view of an animation must have the size of the first",
        )),
    }
}
