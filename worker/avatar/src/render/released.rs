//! Frames as the released HumanNeRF program renders them (`numerics = "reference"`), with its rays,
//! sample positions and compositing, for comparison with that program. Its unsound numerics are
//! kept: likelihoods above 1, a last step of 10¹⁰ m, and rays that are chosen by their number of
//! plane hits.
//!
//! Compositing runs on the host, without gradients: the networks take nearly all of the time.

use super::frame::{RenderError, Rendered, Renderer};
use super::samples::SampleCounts;
use super::view::{ActorBody, SceneView};
use crate::avatar::{AvatarField, Posed};
use crate::host::read;
use crate::motion::body::CanonicalBody;
use burn::tensor::{Tensor, TensorData};
use yoto_capture::body_box::{BodyView, Ray};
use yoto_ops::warp::cpu::forward_unclamped;

/// Rays per batch, which bounds the memory of frames of any size.
const RAYS_PER_BATCH: usize = 1024;
/// Margin of the box in the ray test beyond that of the sound numerics, metres.
const TEST_MARGIN: f64 = 0.01;
/// Distance from the box at which a plane hit still counts, metres.
const HIT_TOLERANCE: f64 = 1e-6;
/// Replaces direction components of smaller magnitude, whatever their sign.
const LEAST_COMPONENT: f64 = 1e-5;
/// Step of the last sample, in units of the ray's direction.
const LAST_STEP: f32 = 1e10;
/// Added to each factor of the transmittance.
const CLEAR_GUARD: f32 = 1e-10;

/// The ray through image position (`u`, `v`), pixels, when exactly two of its hits with the box's
/// six planes lie on the box. Near and far are distances, also for hits behind the camera.
fn ray(body_view: &BodyView, u: f64, v: f64) -> Option<Ray> {
    let low = body_view.bounds.min.map(|c| c - TEST_MARGIN);
    let high = body_view.bounds.max.map(|c| c + TEST_MARGIN);
    let direction = body_view.direction(u, v).map(|d| {
        if d.abs() < LEAST_COMPONENT {
            LEAST_COMPONENT
        } else {
            d
        }
    });
    let mut hits = Vec::with_capacity(6);
    for planes in [low, high] {
        for a in 0..3 {
            let along = (planes[a] - body_view.origin[a]) / direction[a];
            let on_box = (0..3).all(|b| {
                let p = body_view.origin[b] + along * direction[b];
                p >= low[b] - HIT_TOLERANCE && p <= high[b] + HIT_TOLERANCE
            });
            if on_box {
                hits.push(along.abs());
            }
        }
    }
    let [one, other] = hits[..] else {
        return None;
    };
    Some(Ray {
        origin: body_view.origin.map(|v| v as f32),
        direction: direction.map(|v| v as f32),
        near: one.min(other) as f32,
        far: one.max(other) as f32,
    })
}

/// `count` distances from near to far, both included.
fn distances(ray: &Ray, count: usize) -> impl Iterator<Item = f32> {
    let (near, far) = (ray.near, ray.far);
    (0..count).map(move |m| {
        let t = m as f32 / (count - 1) as f32;
        near * (1.0 - t) + far * t
    })
}

/// Sums over the evaluated samples of one ray, near to far.
struct RaySums {
    rgb: [f32; 3],
    alpha: f32,
    depth: f32,
    /// Transmittance in front of the next sample.
    clear: f32,
}

impl RaySums {
    const NOTHING: Self = Self {
        rgb: [0.0; 3],
        alpha: 0.0,
        depth: 0.0,
        clear: 1.0,
    };

    fn add(&mut self, rgb: &[f32], alpha: f32, distance: f32) {
        let weight = self.clear * alpha;
        for (sum, value) in self.rgb.iter_mut().zip(rgb) {
            *sum += weight * value;
        }
        self.alpha += weight;
        self.depth += weight * distance;
        self.clear *= 1.0 - alpha + CLEAR_GUARD;
    }
}

impl Renderer {
    /// A view of one person.
    pub(super) fn render_as_released(
        &self,
        field: AvatarField<'_>,
        actors: &[ActorBody<'_>],
        view: &SceneView,
        keep_going: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Rendered, RenderError> {
        let [ActorBody { actor, body }] = *actors else {
            return Err(RenderError::OnePerson(actors.len()));
        };
        let (width, height) = (view.camera.width as usize, view.camera.height as usize);
        let mut frame = Rendered::empty(view);
        let posed = self.avatar.pose(
            &self.config,
            body,
            actor.slot,
            &actor.pose,
            self.schedule_progress,
        );
        let (weights, transforms) = (
            read(posed.weights.clone())?,
            read(posed.known_transforms())?,
        );
        let body_view = BodyView::new(&body.skeleton, &actor.pose, &view.camera);
        // HumanNeRF's rays pass through pixel coordinates i, which is i + 0.5 with a principal
        // point moved by half a pixel.
        let pixel = |i: usize| {
            ray(
                &body_view,
                (i % width) as f64 + 0.5,
                (i / width) as f64 + 0.5,
            )
        };
        let hits: Vec<(usize, Ray)> = (0..width * height)
            .filter_map(|i| Some((i, pixel(i)?)))
            .collect();
        for (index, batch) in hits.chunks(RAYS_PER_BATCH).enumerate() {
            if !keep_going((index * RAYS_PER_BATCH) as f64 / hits.len() as f64) {
                return Err(RenderError::Stopped);
            }
            let (seen, counts) = look(field, body, &posed, (&weights, &transforms), batch)?;
            frame.counts += counts;
            for ((pixel, _), seen) in batch.iter().zip(seen) {
                for (c, background) in view.background.iter().enumerate() {
                    frame.rgb[3 * pixel + c] = seen.rgb[c] + (1.0 - seen.alpha) * background;
                }
                frame.alpha[*pixel] = seen.alpha;
                frame.depth[*pixel] = seen.depth;
            }
        }
        Ok(frame)
    }
}

/// Sums of a batch of rays, and how many samples were evaluated.
fn look(
    field: AvatarField<'_>,
    body: &CanonicalBody,
    posed: &Posed,
    (weights, transforms): (&[f32], &[f32]),
    batch: &[(usize, Ray)],
) -> Result<(Vec<RaySums>, SampleCounts), RenderError> {
    let per_ray = field.config.march.samples;
    let points: Vec<f32> = batch
        .iter()
        .flat_map(|(_, ray)| {
            distances(ray, per_ray)
                .flat_map(move |t| (0..3).map(move |a| ray.origin[a] + t * ray.direction[a]))
        })
        .collect();
    let warped = forward_unclamped(weights, transforms, &points, &body.grid);
    // α is at most the sum of weights, whatever the density.
    let live: Vec<&[f32; 4]> = warped
        .as_chunks::<4>()
        .0
        .iter()
        .filter(|point| point[3] > field.config.march.epsilon)
        .collect();
    let mut seen: Vec<RaySums> = batch.iter().map(|_| RaySums::NOTHING).collect();
    let counts = SampleCounts {
        rays: batch.len() as u64,
        placed: (batch.len() * per_ray) as u64,
        likely: live.len() as u64,
        evaluated: live.len() as u64,
    };
    if live.is_empty() {
        return Ok((seen, counts));
    }
    let canonical: Vec<f32> = live.iter().flat_map(|p| p[..3].iter().copied()).collect();
    let canonical = TensorData::new(canonical, [live.len(), 3]);
    let canonical = Tensor::<2>::from_data(canonical, &body.log_prior.device());
    let values = field.values(body, posed, canonical);
    let (rgb, density) = (read(values.rgb)?, read(values.density)?);
    let mut fields = rgb.chunks_exact(3).zip(density);
    for (at, (seen, (_, ray))) in seen.iter_mut().zip(batch).enumerate() {
        let length = ray.direction.iter().map(|d| d * d).sum::<f32>().sqrt();
        let distances: Vec<f32> = distances(ray, per_ray).collect();
        let samples = &warped[4 * at * per_ray..4 * (at + 1) * per_ray];
        for (m, point) in samples.as_chunks::<4>().0.iter().enumerate() {
            if point[3] <= field.config.march.epsilon {
                continue;
            }
            let Some((rgb, density)) = fields.next() else {
                return Err(RenderError::Device("fewer field values than points".into()));
            };
            let step = distances
                .get(m + 1)
                .map_or(LAST_STEP, |next| next - distances[m]);
            let alpha = (1.0 - (-density * step * length).exp()) * point[3];
            seen.add(rgb, alpha, distances[m]);
        }
    }
    Ok((seen, counts))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_stand_at_both_ends() {
        let ray = Ray {
            origin: [0.0; 3],
            direction: [0.0, 0.0, 1.0],
            near: 2.0,
            far: 4.0,
        };
        let distances: Vec<f32> = distances(&ray, 5).collect();
        assert_eq!(distances, [2.0, 2.5, 3.0, 3.5, 4.0]);
    }

    #[test]
    fn near_samples_dim_far_ones() {
        let mut seen = RaySums::NOTHING;
        seen.add(&[1.0, 0.0, 0.0], 0.75, 2.0);
        seen.add(&[0.0, 1.0, 0.0], 1.0, 4.0);
        assert!((seen.rgb[0] - 0.75).abs() < 1e-6 && (seen.rgb[1] - 0.25).abs() < 1e-6);
        assert!((seen.alpha - 1.0).abs() < 1e-6 && (seen.depth - 2.5).abs() < 1e-6);
    }
}
