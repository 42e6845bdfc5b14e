//! Samples along rays, and the choice of those that are evaluated. A sample is left out if its
//! foreground likelihood is below ε ([`MarchConfig::epsilon`]), which bounds its opacity, or if the
//! person's occupancy grid is empty there.

use super::occupancy::Occupancy;
use crate::config::{MarchConfig, Unposing};
use crate::ops::warp::WarpGrid;
use crate::ops::warp::inverse::solve::Skinning;
use crate::ops::warp::likelihood::{Segment, along_rays_with};
use rand::RngExt;
use std::ops::AddAssign;
use yoto_capture::body_box::Ray;

/// The space that a posed person occupies.
pub struct Volume<'a> {
    /// `[K + 1, V]` motion weights, in host memory.
    pub weights: &'a [f32],
    /// `[K, 12]` transforms from the posed body to the canonical box, in host memory.
    pub transforms: &'a [f32],
    /// The grid of the weights.
    pub grid: &'a WarpGrid,
    /// The way to canonical points.
    pub unposing: Unposing,
    /// Known empty parts of canonical space.
    pub occupancy: Option<&'a Occupancy>,
    /// Number of the training step, in which a few samples in empty cells are kept; `None` when
    /// rendering.
    pub step: Option<u64>,
}

/// The live samples of some rays, ray by ray, near to far.
#[derive(Debug, Default)]
pub struct Samples {
    /// Number of rays, including those that miss the box.
    pub rays: usize,
    /// Samples per ray, live or not.
    pub per_ray: usize,
    /// `[n, 3]` positions in the body frame, metres.
    pub points: Vec<f32>,
    /// `[n, 3]` positions in the canonical box, metres, after the warp.
    pub canonical: Vec<f32>,
    /// `[n]` foreground likelihoods in [0, 1].
    pub likelihoods: Vec<f32>,
    /// `[n]` step lengths, metres.
    pub steps: Vec<f32>,
    /// `[n]` distances along the camera's axis, metres.
    pub depths: Vec<f32>,
    /// `[n]` ray · per_ray + sample.
    pub places: Vec<i64>,
    /// Number of samples with a likelihood of at least ε, in occupied cells or not.
    pub likely: usize,
}

/// Number of samples that passed each test. Each count includes the following ones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SampleCounts {
    /// Number of rays, including those that miss the box.
    pub rays: u64,
    /// Samples on all rays, including those that miss the box.
    pub placed: u64,
    /// Samples with a foreground likelihood of at least ε.
    pub likely: u64,
    /// Those in a cell that is not known to be empty.
    pub occupied: u64,
    /// Those that were evaluated, because no opaque samples hide them.
    pub evaluated: u64,
}

impl SampleCounts {
    /// Share of the samples that were evaluated.
    pub fn live_fraction(&self) -> f64 {
        self.evaluated as f64 / self.placed.max(1) as f64
    }

    /// Mean of a count per ray.
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
    /// Number of live samples.
    pub fn live(&self) -> usize {
        self.places.len()
    }

    /// `[R + 1]`: index of each ray's first live sample, followed by their number.
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

    /// Counts if all live samples are evaluated.
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

/// Places one sample in each stratum of each ray, at random with `jitter` and in the middle
/// without, and keeps those that `volume` does not rule out. Strata divide the part of a ray
/// inside the body's box equally; only those inside the support of a bone are visited.
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
    let skinning = match volume.unposing {
        Unposing::Blend => None,
        Unposing::Inverse => Some(Skinning::new(
            volume.weights,
            volume.transforms,
            volume.grid,
        )),
    };
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
                    skinning.as_ref(),
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

/// Adds the live samples of one ray, whose first sample has the given `place`.
#[allow(clippy::too_many_arguments)]
fn keep_live(
    ray: &Segment,
    place: usize,
    depths: &[f32],
    warped: &[[f32; 4]],
    epsilon: f32,
    volume: &Volume,
    skinning: Option<&Skinning<'_>>,
    live: &mut Samples,
) {
    let length = ray.direction.iter().map(|d| d * d).sum::<f32>().sqrt();
    for (m, (&depth, &[x, y, z, likelihood])) in depths.iter().zip(warped).enumerate() {
        if likelihood < epsilon {
            continue;
        }
        live.likely += 1;
        let point: [f32; 3] = std::array::from_fn(|a| ray.origin[a] + depth * ray.direction[a]);
        let blend = [x, y, z];
        // A search costs more than all else here; far from the body it finds empty cells.
        if let (Some(_), Some(grid)) = (skinning, volume.occupancy)
            && !grid.admits_near(blend, volume.step)
        {
            continue;
        }
        let found = skinning.and_then(|skinning| skinning.search(point, blend));
        let canonical = found.unwrap_or(blend);
        if volume
            .occupancy
            .is_some_and(|grid| !grid.admits(canonical, volume.step))
        {
            continue;
        }
        // The last sample's step ends where the ray leaves the box.
        let next = depths.get(m + 1).copied().unwrap_or(ray.far);
        live.points.extend(point);
        live.canonical.extend(canonical);
        live.likelihoods.push(likelihood);
        live.steps.push((next - depth) * length);
        live.depths.push(depth);
        live.places.push((place + m) as i64);
    }
}
