//! Pictures of people of several models, of which some consist of fields and others of splats.
//!
//! Both are positions along a ray with an opacity and a colour, so that all that a pixel meets is blended in the
//! order of its depth. Splats alone are drawn in one pass, as those of one model are.

use super::fields::{RaySample, composite_samples};
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
pub struct ModelActor<'a> {
    /// The model.
    pub model: &'a Renderer,
    /// The person, in a slot of it.
    pub actor: &'a Actor,
}

/// Renders people of any models in one picture, in which they hide each other, until `keep_going` returns false, which
/// is told the finished share before each batch of rays. The picture has a ray per pixel, whatever the models'
/// scale.
///
/// # Errors
/// As [`Renderer::render_scene`].
pub fn render_together(
    people: &[ModelActor<'_>],
    camera: &Camera,
    background: [f32; 3],
    keep_going: &mut dyn FnMut(f64) -> bool,
) -> Result<Rendered, RenderError> {
    let alone = |person: &ModelActor<'_>| SceneView {
        actors: vec![person.actor.clone()],
        camera: camera.clone(),
        background,
    };
    let views: Vec<SceneView> = people.iter().map(alone).collect();
    let (mut fields, mut splats) = (Vec::new(), Vec::new());
    for (ModelActor { model, .. }, view) in people.iter().zip(&views) {
        if model.config().numerics == Numerics::Reference {
            return Err(RenderError::OnePerson(people.len()));
        }
        for actor_body in model.actor_bodies(view)? {
            match model.avatar.appearance(model.config()) {
                AvatarAppearance::Splats(avatar) => {
                    splats.push(model.actor_splats(avatar, &actor_body, view)?)
                }
                AvatarAppearance::Field(field) => {
                    fields.push((model, model.posed_actor(field, &actor_body, view)?));
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
        .map(|(splats, body_view)| Probe::new(splats.as_slices(), body_view))
        .collect();
    let mut frame = Rendered::empty(&nobody);
    let pixels: Vec<usize> = (0..frame.alpha.len()).collect();
    for (index, batch) in pixels.chunks(PIXELS_PER_BATCH).enumerate() {
        if !keep_going((index * PIXELS_PER_BATCH) as f64 / pixels.len() as f64) {
            return Err(RenderError::Stopped);
        }
        let mut samples_by_ray: Vec<Vec<RaySample>> = batch.iter().map(|_| Vec::new()).collect();
        for (model, posed_actor) in &fields {
            let hits = posed_actor.hits(batch, frame.width);
            model.march_through(
                posed_actor,
                &hits,
                Some(&mut samples_by_ray),
                &mut frame.counts,
            )?;
        }
        let sums: Vec<_> = (samples_by_ray.into_par_iter().zip(batch))
            .map(|(mut samples_by_ray, pixel)| {
                for probe in &probes {
                    let splats = probe.splats_at(*pixel);
                    samples_by_ray.extend(splats.map(|(depth, alpha, rgb)| RaySample {
                        depth,
                        alpha,
                        rgb,
                    }));
                }
                composite_samples(samples_by_ray)
            })
            .collect();
        for (sums, pixel) in sums.iter().zip(batch) {
            frame.put(*pixel, sums, background);
        }
    }
    Ok(frame)
}
