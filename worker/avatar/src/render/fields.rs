//! Frames of models that consist of fields.

use super::frame::{RenderError, Rendered, Renderer};
use super::march::{Volume, march};
use super::samples::SampleCounts;
use super::view::{ActorBody, SceneView};
use crate::avatar::{AvatarField, Posed};
use crate::host::read;
use burn::tensor::{Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use yoto_capture::body_box::{BodyView, Ray};
use yoto_ops::composite::{RayAccumulator, opacity};

/// Pixels per batch, which bounds the memory of frames of any size.
const PIXELS_PER_BATCH: usize = 8192;

/// Live samples per ray in the first wave; each further wave has twice as many.
const FIRST_WAVE: usize = 8;

/// An actor in their pose, for rays to march through.
pub(super) struct PosedActor<'a> {
    field: AvatarField<'a>,
    actor_body: ActorBody<'a>,
    posed: Posed,
    weights: Vec<f32>,
    transforms: Vec<f32>,
    body_view: BodyView,
}

/// A sample of a ray: what it meets at one position.
pub(super) struct RaySample {
    pub depth: f32,
    pub alpha: f32,
    pub rgb: [f32; 3],
}

impl PosedActor<'_> {
    /// The ray of pixel number `i` of a picture of this `width`, if it crosses the person's box.
    fn ray(&self, i: usize, width: usize) -> Option<Ray> {
        let (u, v) = ((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
        self.body_view.ray(u, v)
    }

    /// The rays of a `batch` of pixels that cross the person's box, with their indices in it.
    pub(super) fn hits(&self, batch: &[usize], width: usize) -> Vec<(usize, Ray)> {
        let pixels = batch.iter().enumerate();
        let hits = pixels.filter_map(|(at, i)| Some((at, self.ray(*i, width)?)));
        hits.collect()
    }
}

impl Renderer {
    /// Renders a view of people with fields. A field is evaluated only along rays that cross its
    /// person's box.
    pub(super) fn render_fields(
        &self,
        field: AvatarField<'_>,
        actors: &[ActorBody<'_>],
        view: &SceneView,
        keep_going: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Rendered, RenderError> {
        let posed_actors = actors
            .iter()
            .map(|actor_body| self.posed_actor(field, actor_body, view));
        let posed_actors = posed_actors.collect::<Result<Vec<_>, _>>()?;
        let (width, height) = (view.camera.width as usize, view.camera.height as usize);
        let mut frame = Rendered::empty(view);
        let pixels: Vec<usize> = (0..width * height)
            .filter(|i| posed_actors.iter().any(|it| it.ray(*i, width).is_some()))
            .collect();
        for (index, batch) in pixels.chunks(PIXELS_PER_BATCH).enumerate() {
            if !keep_going((index * PIXELS_PER_BATCH) as f64 / pixels.len() as f64) {
                return Err(RenderError::Stopped);
            }
            let sums = match posed_actors.as_slice() {
                // Nothing is merged: every pixel of the batch meets the one box.
                [one] => {
                    self.march_through(one, &one.hits(batch, width), None, &mut frame.counts)?
                }
                several => {
                    let mut samples_by_ray: Vec<Vec<RaySample>> =
                        batch.iter().map(|_| Vec::new()).collect();
                    for one in several {
                        let hits = one.hits(batch, width);
                        self.march_through(
                            one,
                            &hits,
                            Some(&mut samples_by_ray),
                            &mut frame.counts,
                        )?;
                    }
                    samples_by_ray.into_iter().map(composite_samples).collect()
                }
            };
            for (sums, pixel) in sums.iter().zip(batch) {
                frame.put(*pixel, sums, view.background);
            }
        }
        Ok(frame)
    }

    /// An actor of this model, which has a `field`, in their pose.
    pub(super) fn posed_actor<'a>(
        &self,
        field: AvatarField<'a>,
        actor_body: &ActorBody<'a>,
        view: &SceneView,
    ) -> Result<PosedActor<'a>, RenderError> {
        let ActorBody { actor, body } = *actor_body;
        let (slot, pose) = (actor.slot, &actor.pose);
        let posed = (self.avatar).pose(&self.config, body, slot, pose, self.schedule_progress);
        Ok(PosedActor {
            field,
            actor_body: *actor_body,
            weights: read(posed.weights.clone())?,
            transforms: read(posed.known_transforms())?,
            posed,
            body_view: BodyView::new(&body.skeleton, pose, &view.camera),
        })
    }

    /// Sums along `hits`, rays with their indices in a batch, front to back in waves, so that samples
    /// behind opaque ones are not evaluated. The samples of the ray of each index are also added to `samples_by_ray`.
    pub(super) fn march_through(
        &self,
        posed_actor: &PosedActor<'_>,
        hits: &[(usize, Ray)],
        mut samples_by_ray: Option<&mut [Vec<RaySample>]>,
        total: &mut SampleCounts,
    ) -> Result<Vec<RayAccumulator>, RenderError> {
        let ActorBody { actor, body } = posed_actor.actor_body;
        let volume = Volume {
            weights: &posed_actor.weights,
            transforms: &posed_actor.transforms,
            grid: &body.grid,
            unposing: self.config.motion.unposing,
            occupancy: self.occupancy[actor.slot].as_ref(),
            step: None,
        };
        let rays: Vec<Option<Ray>> = hits.iter().map(|(_, ray)| Some(*ray)).collect();
        let settings = &posed_actor.field.config.march;
        let candidates = march(&rays, settings, None::<&mut ChaCha8Rng>, &volume);
        let mut walk = candidates.walk();
        let mut sums = vec![RayAccumulator::START; rays.len()];
        let mut counts = candidates.counts();
        let mut wave = match settings.min_transmittance > 0.0 {
            true => FIRST_WAVE,
            false => usize::MAX,
        };
        let device = body.log_prior.device();
        while !walk.is_over() {
            let samples = walk.wave(wave);
            let count = samples.live();
            counts.evaluated += count as u64;
            if count == 0 {
                continue;
            }
            let points = TensorData::new(samples.canonical.clone(), [count, 3]);
            let points = Tensor::<2>::from_data(points, &device);
            let values = posed_actor.field.values(body, &posed_actor.posed, points);
            let (rgb, density) = (read(values.rgb)?, read(values.density)?);
            if (rgb.len(), density.len()) != (3 * count, count) {
                return Err(RenderError::Device("fewer field values than points".into()));
            }
            for (i, (rgb, density)) in rgb.as_chunks::<3>().0.iter().zip(density).enumerate() {
                let ray = samples.ray(i);
                let sums = &mut sums[ray];
                if sums.transmittance >= settings.min_transmittance {
                    let alpha = opacity(density, samples.steps[i], samples.likelihoods[i]);
                    let depth = samples.depths[i];
                    sums.add(rgb, alpha, depth);
                    if let Some(samples_by_ray) = &mut samples_by_ray {
                        let rgb = *rgb;
                        samples_by_ray[hits[ray].0].push(RaySample { depth, alpha, rgb });
                    }
                }
            }
            walk.keep(|ray| sums[ray].transmittance >= settings.min_transmittance);
            wave = wave.saturating_mul(2);
        }
        *total += counts;
        Ok(sums)
    }
}

/// Composites the samples of a ray from all people, near to far.
pub(super) fn composite_samples(mut samples: Vec<RaySample>) -> RayAccumulator {
    samples.sort_by(|a, b| a.depth.total_cmp(&b.depth));
    let mut sums = RayAccumulator::START;
    for RaySample { depth, alpha, rgb } in samples {
        sums.add(&rgb, alpha, depth);
    }
    sums
}
