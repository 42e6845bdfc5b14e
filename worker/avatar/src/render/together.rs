//! Pictures of people of several models, of which some consist of fields and others of splats.
//!
//! Both are positions along a ray with an opacity and a colour, so that all that a pixel meets is blended in the
//! order of its depth. Splats alone are drawn in one pass, as those of one model are.

use super::fields::{Met, merged};
use super::frame::{RenderError, Rendered, Renderer};
use super::splats::blended;
use super::view::{Actor, SceneView};
use crate::avatar::AvatarAppearance;
use crate::config::Numerics;
use rayon::prelude::*;
use yoto_capture::camera::Camera;
use yoto_ops::splat::probe::Probe;

/// Pixels per batch, which bounds the memory of frames of any size.
const PIXELS_PER_BATCH: usize = 8192;

/// A person of a model.
#[derive(Clone, Copy)]
pub struct Guest<'a> {
    /// The model.
    pub model: &'a Renderer,
    /// The person, in a slot of it.
    pub actor: &'a Actor,
}

/// Renders people of any models in one picture, in which they hide each other, as long as `go_on` says so, which
/// is told the finished share before each batch of rays. The picture has a ray per pixel, whatever the models'
/// scale.
///
/// # Errors
/// As [`Renderer::render_scene`].
pub fn render_together(
    guests: &[Guest<'_>],
    camera: &Camera,
    background: [f32; 3],
    go_on: &mut dyn FnMut(f64) -> bool,
) -> Result<Rendered, RenderError> {
    let alone = |guest: &Guest<'_>| SceneView {
        actors: vec![guest.actor.clone()],
        camera: camera.clone(),
        background,
    };
    let views: Vec<SceneView> = guests.iter().map(alone).collect();
    let (mut fields, mut splats) = (Vec::new(), Vec::new());
    for (Guest { model, .. }, view) in guests.iter().zip(&views) {
        if model.config().numerics == Numerics::Reference {
            return Err(RenderError::OnePerson(guests.len()));
        }
        for shown in model.shown(view)? {
            match model.avatar.appearance(model.config()) {
                AvatarAppearance::Splats(avatar) => splats.push(model.lit(avatar, &shown, view)?),
                AvatarAppearance::Field(field) => {
                    fields.push((model, model.staged(field, &shown, view)?));
                }
            }
        }
    }
    let nobody = SceneView {
        actors: Vec::new(),
        camera: camera.clone(),
        background,
    };
    if fields.is_empty() {
        return Ok(blended(&splats, &nobody));
    }
    let probes: Vec<Probe<'_>> = (splats.iter())
        .map(|(splats, sight)| Probe::new(splats.numbers(), sight))
        .collect();
    let mut frame = Rendered::empty(&nobody);
    let pixels: Vec<usize> = (0..frame.alpha.len()).collect();
    for (index, batch) in pixels.chunks(PIXELS_PER_BATCH).enumerate() {
        if !go_on((index * PIXELS_PER_BATCH) as f64 / pixels.len() as f64) {
            return Err(RenderError::Stopped);
        }
        let mut met: Vec<Vec<Met>> = batch.iter().map(|_| Vec::new()).collect();
        for (model, staged) in &fields {
            let hits = staged.hits(batch, frame.width);
            model.march_through(staged, &hits, Some(&mut met), &mut frame.counts)?;
        }
        let sums: Vec<_> = (met.into_par_iter().zip(batch))
            .map(|(mut met, pixel)| {
                for probe in &probes {
                    let splats = probe.splats_at(*pixel);
                    met.extend(splats.map(|(depth, alpha, rgb)| Met { depth, alpha, rgb }));
                }
                merged(met)
            })
            .collect();
        for (sums, pixel) in sums.iter().zip(batch) {
            frame.put(*pixel, sums, background);
        }
    }
    Ok(frame)
}
