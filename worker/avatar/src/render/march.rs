//! Samples along rays, and which of them matter: a sample whose foreground likelihood is under
//! ε is not evaluated (84 % of a frame at 1e-4, at a difference of 1e-4 in colour), nor is one
//! where the person's occupancy grid has seen nothing.

use super::occupancy::Occupancy;
use super::rays::Ray;
use crate::config::MarchConfig;
use crate::ops::warp::WarpGrid;
use crate::ops::warp::likelihood::{Segment, along_rays_with};
use rand::RngExt;
use std::ops::AddAssign;

/// Where a posed person is: what decides which samples matter.
pub struct Volume<'a> {
    /// Of [`crate::ops::warp::warp`], in host memory.
    pub weights: &'a [f32],
    /// Of [`crate::ops::warp::warp`], in host memory.
    pub transforms: &'a [f32],
    /// The grid of the weights.
    pub grid: &'a WarpGrid,
    /// Where canonical space is known to be empty.
    pub occupancy: Option<&'a Occupancy>,
    /// In a step of training, which one: a few samples in empty cells are kept then.
    pub step: Option<u64>,
}

/// The live samples of some rays, ray by ray, near to far.
#[derive(Debug, Default)]
pub struct Samples {
    /// Rays, with those that miss the box.
    pub rays: usize,
    /// Samples a ray, live or not.
    pub per_ray: usize,
    /// `[n, 3]` positions in the body frame, metres.
    pub points: Vec<f32>,
    /// `[n, 3]` positions in the canonical box, metres, as the warp has them.
    pub canonical: Vec<f32>,
    /// `[n]` foreground likelihoods in [0, 1], as the warp has them.
    pub likelihoods: Vec<f32>,
    /// `[n]` step lengths, metres.
    pub steps: Vec<f32>,
    /// `[n]` distances along the camera's axis, metres.
    pub depths: Vec<f32>,
    /// `[n]` ray · per_ray + sample.
    pub places: Vec<i64>,
    /// Samples with a likelihood of at least ε, in occupied cells or not.
    pub likely: usize,
}

/// How many samples came how far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SampleCounts {
    /// Rays, with those that miss the box.
    pub rays: u64,
    /// Samples on all of them, as if each had met the box.
    pub placed: u64,
    /// With a foreground likelihood of at least ε.
    pub likely: u64,
    /// Also in a cell that is not known to be empty.
    pub occupied: u64,
    /// Also evaluated, not being hidden behind what is opaque already.
    pub evaluated: u64,
}

impl SampleCounts {
    /// Share of the samples that was evaluated.
    pub fn live_fraction(&self) -> f64 {
        self.evaluated as f64 / self.placed.max(1) as f64
    }

    /// A count's mean a ray.
    pub fn per_ray(&self, count: u64) -> f64 {
        count as f64 / self.rays.max(1) as f64
    }
}

impl AddAssign for SampleCounts {
    fn add_assign(&mut self, other: Self) {
        self.rays += other.rays;
        self.placed += other.placed;
        self.likely += other.likely;
        self.occupied += other.occupied;
        self.evaluated += other.evaluated;
    }
}

impl Samples {
    /// Live samples.
    pub fn live(&self) -> usize {
        self.places.len()
    }

    /// `[R + 1]`: where each ray's live samples start, and at last their number.
    pub fn starts(&self) -> Vec<usize> {
        let mut starts = Vec::with_capacity(self.rays + 1);
        for (i, place) in self.places.iter().enumerate() {
            let ray = *place as usize / self.per_ray;
            while starts.len() <= ray {
                starts.push(i);
            }
        }
        starts.resize(self.rays + 1, self.live());
        starts
    }

    /// What was left out, when all live samples are evaluated.
    pub fn counts(&self) -> SampleCounts {
        SampleCounts {
            rays: self.rays as u64,
            placed: (self.rays * self.per_ray) as u64,
            likely: self.likely as u64,
            occupied: self.live() as u64,
            evaluated: self.live() as u64,
        }
    }

    fn append(&mut self, mut other: Self) {
        self.points.append(&mut other.points);
        self.canonical.append(&mut other.canonical);
        self.likelihoods.append(&mut other.likelihoods);
        self.steps.append(&mut other.steps);
        self.depths.append(&mut other.depths);
        self.places.append(&mut other.places);
        self.likely += other.likely;
    }
}

/// Places samples on each ray (stratified with `jitter`, mid-stratum without) and keeps those
/// that matter in `volume`. Strata divide a ray's way through the body's box; of them, only
/// those inside the support of a bone are visited.
pub fn march(
    rays: &[Option<Ray>],
    config: &MarchConfig,
    mut jitter: Option<&mut impl RngExt>,
    volume: &Volume,
) -> Samples {
    let per_ray = config.samples;
    let (hits, segments): (Vec<usize>, Vec<Segment>) = rays
        .iter()
        .enumerate()
        .filter_map(|(r, ray)| {
            let ray = ray.as_ref()?;
            let segment = Segment {
                origin: ray.origin,
                direction: ray.direction,
                near: ray.near,
                far: ray.far,
            };
            Some((r, segment))
        })
        .unzip();
    let mut depths = Vec::with_capacity(segments.len() * per_ray);
    for ray in &segments {
        let stratum = (ray.far - ray.near) / per_ray as f32;
        for m in 0..per_ray {
            let offset = jitter.as_mut().map_or(0.5, |rng| rng.random::<f32>());
            depths.push(ray.near + (m as f32 + offset) * stratum);
        }
    }
    let blocks = along_rays_with(
        volume.weights,
        volume.transforms,
        &segments,
        &depths,
        volume.grid,
        |first, warped| {
            let mut live = Samples::default();
            for (at, warped) in (first..).zip(warped.chunks_exact(per_ray)) {
                let depths = &depths[at * per_ray..(at + 1) * per_ray];
                keep_live(
                    &segments[at],
                    hits[at] * per_ray,
                    depths,
                    warped,
                    config.epsilon,
                    volume,
                    &mut live,
                );
            }
            live
        },
    );
    let mut samples = Samples {
        rays: rays.len(),
        per_ray,
        ..Samples::default()
    };
    for block in blocks {
        samples.append(block);
    }
    samples
}

/// Adds the live samples of one ray, whose first sample has `place`.
fn keep_live(
    ray: &Segment,
    place: usize,
    depths: &[f32],
    warped: &[[f32; 4]],
    epsilon: f32,
    volume: &Volume,
    live: &mut Samples,
) {
    let length = ray.direction.iter().map(|d| d * d).sum::<f32>().sqrt();
    for (m, (&depth, &[x, y, z, likelihood])) in depths.iter().zip(warped).enumerate() {
        if likelihood < epsilon {
            continue;
        }
        live.likely += 1;
        let canonical = [x, y, z];
        if volume
            .occupancy
            .is_some_and(|grid| !grid.admits(canonical, volume.step))
        {
            continue;
        }
        // The last sample's step ends where the ray leaves the box.
        let next = depths.get(m + 1).copied().unwrap_or(ray.far);
        live.points
            .extend((0..3).map(|a| ray.origin[a] + depth * ray.direction[a]));
        live.canonical.extend(canonical);
        live.likelihoods.push(likelihood);
        live.steps.push((next - depth) * length);
        live.depths.push(depth);
        live.places.push((place + m) as i64);
    }
}
