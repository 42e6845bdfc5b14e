//! Frames of models that consist of fields.

use super::frame::{RenderError, Rendered, Renderer};
use super::march::{Volume, march};
use super::samples::SampleCounts;
use super::view::{SceneView, Shown};
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
pub(super) struct Staged<'a> {
    field: AvatarField<'a>,
    shown: Shown<'a>,
    posed: Posed,
    weights: Vec<f32>,
    transforms: Vec<f32>,
    sight: BodyView,
}

/// What a ray meets at one position.
pub(super) struct Met {
    pub depth: f32,
    pub alpha: f32,
    pub rgb: [f32; 3],
}

impl Staged<'_> {
    /// The ray of pixel number `i` of a picture of this `width`, if it crosses the person's box.
    fn ray(&self, i: usize, width: usize) -> Option<Ray> {
        let (u, v) = ((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
        self.sight.ray(u, v)
    }

    /// The rays of a `batch` of pixels that cross the person's box, with their indices in it.
    pub fn hits(&self, batch: &[usize], width: usize) -> Vec<(usize, Ray)> {
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
        shown: &[Shown<'_>],
        view: &SceneView,
        go_on: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Rendered, RenderError> {
        let staged = shown.iter().map(|shown| self.staged(field, shown, view));
        let staged = staged.collect::<Result<Vec<_>, _>>()?;
        let (width, height) = (view.camera.width as usize, view.camera.height as usize);
        let mut frame = Rendered::empty(view);
        let pixels: Vec<usize> = (0..width * height)
            .filter(|i| staged.iter().any(|it| it.ray(*i, width).is_some()))
            .collect();
        for (index, batch) in pixels.chunks(PIXELS_PER_BATCH).enumerate() {
            if !go_on((index * PIXELS_PER_BATCH) as f64 / pixels.len() as f64) {
                return Err(RenderError::Stopped);
            }
            let sums = match staged.as_slice() {
                // Nothing is merged: every pixel of the batch meets the one box.
                [one] => {
                    self.march_through(one, &one.hits(batch, width), None, &mut frame.counts)?
                }
                several => {
                    let mut met: Vec<Vec<Met>> = batch.iter().map(|_| Vec::new()).collect();
                    for one in several {
                        let hits = one.hits(batch, width);
                        self.march_through(one, &hits, Some(&mut met), &mut frame.counts)?;
                    }
                    met.into_iter().map(merged).collect()
                }
            };
            for (sums, pixel) in sums.iter().zip(batch) {
                frame.put(*pixel, sums, view.background);
            }
        }
        Ok(frame)
    }

    /// An actor of this model, which has a `field`, in their pose.
    pub(super) fn staged<'a>(
        &self,
        field: AvatarField<'a>,
        shown: &Shown<'a>,
        view: &SceneView,
    ) -> Result<Staged<'a>, RenderError> {
        let Shown { actor, body } = *shown;
        let (slot, pose) = (actor.slot, &actor.pose);
        let posed = (self.avatar).pose(&self.config, body, slot, pose, self.progress);
        Ok(Staged {
            field,
            shown: *shown,
            weights: read(posed.weights.clone())?,
            transforms: read(posed.transforms.clone())?,
            posed,
            sight: BodyView::new(&body.skeleton, pose, &view.camera),
        })
    }

    /// Sums along `hits`, rays with their indices in a batch, front to back in waves, so that samples
    /// behind opaque ones are not evaluated. What the ray of each index meets is also added to `met`.
    pub(super) fn march_through(
        &self,
        staged: &Staged<'_>,
        hits: &[(usize, Ray)],
        mut met: Option<&mut [Vec<Met>]>,
        total: &mut SampleCounts,
    ) -> Result<Vec<RayAccumulator>, RenderError> {
        let Shown { actor, body } = staged.shown;
        let volume = Volume {
            weights: &staged.weights,
            transforms: &staged.transforms,
            grid: &body.grid,
            unposing: self.config.motion.unposing,
            occupancy: self.occupancy[actor.slot].as_ref(),
            step: None,
        };
        let rays: Vec<Option<Ray>> = hits.iter().map(|(_, ray)| Some(*ray)).collect();
        let settings = &staged.field.config.march;
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
            let values = staged.field.values(body, &staged.posed, points);
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
                    if let Some(met) = &mut met {
                        let rgb = *rgb;
                        met[hits[ray].0].push(Met { depth, alpha, rgb });
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

/// Composites everything that a ray meets, from all people, near to far.
pub(super) fn merged(mut met: Vec<Met>) -> RayAccumulator {
    met.sort_by(|a, b| a.depth.total_cmp(&b.depth));
    let mut sums = RayAccumulator::START;
    for Met { depth, alpha, rgb } in met {
        sums.add(&rgb, alpha, depth);
    }
    sums
}
