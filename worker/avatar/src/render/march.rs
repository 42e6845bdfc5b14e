//! Samples along rays, and the choice of those that may be evaluated. A sample is left out if its
//! foreground likelihood is below ε ([`MarchConfig::epsilon`]), which bounds its opacity, or if the
//! person's occupancy grid is empty there, which a [`Walk`] finds out.

use super::occupancy::Occupancy;
use super::samples::{SampleCounts, Samples};
use super::walk::{Candidate, Walk};
use crate::config::{MarchConfig, Unposing};
use rand::RngExt;
use yoto_capture::body_box::Ray;
use yoto_ops::warp::WarpGrid;
use yoto_ops::warp::inverse::solve::Skinning;
use yoto_ops::warp::likelihood::{Segment, along_rays};

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

/// Samples that may be live, ray by ray, near to far.
pub struct Candidates<'a> {
    pub(super) volume: &'a Volume<'a>,
    /// Absent if canonical points are not searched.
    pub(super) skinning: Option<Skinning<'a>>,
    /// Number of rays, including those that miss the box.
    pub(super) rays: usize,
    /// Samples per ray, live or not.
    pub(super) per_ray: usize,
    pub(super) list: Vec<Candidate>,
    /// Number of samples with a likelihood of at least ε, in occupied cells or not.
    pub(super) likely: usize,
}

impl Candidates<'_> {
    /// Counts if none are evaluated.
    pub fn counts(&self) -> SampleCounts {
        SampleCounts {
            rays: self.rays as u64,
            placed: (self.rays * self.per_ray) as u64,
            likely: self.likely as u64,
            evaluated: 0,
        }
    }

    /// A walk along all rays.
    pub fn walk(&self) -> Walk<'_> {
        Walk::new(self)
    }

    /// All live samples.
    pub fn all(&self) -> Samples {
        self.walk().wave(usize::MAX)
    }
}

/// Places one sample in each stratum of each ray, at random with `jitter` and in the middle
/// without, and keeps those that `volume` does not rule out at first sight. Strata divide the part of
/// a ray inside the body's box equally; only those inside the support of a bone are visited.
pub fn march<'a>(
    rays: &[Option<Ray>],
    config: &MarchConfig,
    mut jitter: Option<&mut impl RngExt>,
    volume: &'a Volume<'a>,
) -> Candidates<'a> {
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
    let blocks = along_rays(
        volume.weights,
        volume.transforms,
        &segments,
        &depths,
        volume.grid,
        |first, warped| {
            let (mut list, mut likely) = (Vec::new(), 0);
            for (at, warped) in (first..).zip(warped.chunks_exact(per_ray)) {
                let depths = &depths[at * per_ray..(at + 1) * per_ray];
                let place = hits[at] * per_ray;
                likely += keep(
                    &segments[at],
                    place,
                    depths,
                    warped,
                    config,
                    volume,
                    &mut list,
                );
            }
            (list, likely)
        },
    );
    let mut candidates = Candidates {
        volume,
        skinning: match volume.unposing {
            Unposing::Blend => None,
            Unposing::Inverse => Some(Skinning::new(
                volume.weights,
                volume.transforms,
                volume.grid,
            )),
        },
        rays: rays.len(),
        per_ray,
        list: Vec::with_capacity(blocks.iter().map(|(list, _)| list.len()).sum()),
        likely: 0,
    };
    for (mut list, likely) in blocks {
        candidates.list.append(&mut list);
        candidates.likely += likely;
    }
    candidates
}

/// Adds the candidates of one ray, whose first sample has the given `place`, to `list`, and returns
/// the number of its likely samples.
fn keep(
    ray: &Segment,
    place: usize,
    depths: &[f32],
    warped: &[[f32; 4]],
    config: &MarchConfig,
    volume: &Volume,
    list: &mut Vec<Candidate>,
) -> usize {
    let length = ray.direction.iter().map(|d| d * d).sum::<f32>().sqrt();
    let mut likely = 0;
    for (m, (&depth, &[x, y, z, likelihood])) in depths.iter().zip(warped).enumerate() {
        if likelihood < config.epsilon {
            continue;
        }
        likely += 1;
        let blend = [x, y, z];
        let possible = volume.occupancy.is_none_or(|grid| match volume.unposing {
            Unposing::Blend => grid.admits(blend, volume.step),
            // A search costs more than all else here; far from the body it finds empty cells.
            Unposing::Inverse => grid.admits_near(blend, volume.step),
        });
        if !possible {
            continue;
        }
        // The last sample's step ends where the ray leaves the box.
        let next = depths.get(m + 1).copied().unwrap_or(ray.far);
        list.push(Candidate {
            point: std::array::from_fn(|a| ray.origin[a] + depth * ray.direction[a]),
            blend,
            likelihood,
            step: (next - depth) * length,
            depth,
            place: (place + m) as i64,
        });
    }
    likely
}
