//! Walks along rays from near to far, a few live samples at a time, so that nothing is searched or
//! evaluated behind opaque samples.

use super::march::Candidates;
use super::samples::Samples;
use rayon::prelude::*;

/// Rays per task.
const BLOCK: usize = 64;

/// A sample that may be live.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    /// Position in the body frame, metres.
    pub point: [f32; 3],
    /// Its position after the bones have moved it by their weights (paper, eq. 1), metres.
    pub blend: [f32; 3],
    /// Foreground likelihood in [0, 1].
    pub likelihood: f32,
    /// Step length, metres.
    pub step: f32,
    /// Distance along the camera's axis, metres.
    pub depth: f32,
    /// Ray · samples per ray + sample.
    pub place: i64,
}

/// The state of a walk.
pub struct Walk<'c> {
    candidates: &'c Candidates<'c>,
    /// Rays that go on, in order.
    active: Vec<Stretch>,
}

/// Candidates of a ray that a walk has not reached yet.
#[derive(Clone, Copy)]
struct Stretch {
    ray: usize,
    next: usize,
    end: usize,
}

impl<'c> Walk<'c> {
    pub(super) fn new(candidates: &'c Candidates<'c>) -> Self {
        let per_ray = candidates.per_ray as i64;
        let mut next = 0;
        let rays = candidates
            .list
            .chunk_by(|one, other| one.place / per_ray == other.place / per_ray);
        let active = rays.map(|along| {
            let (ray, first) = (along[0].place / per_ray, next);
            next += along.len();
            Stretch {
                ray: ray as usize,
                next: first,
                end: next,
            }
        });
        Self {
            active: active.collect(),
            candidates,
        }
    }

    /// Whether no ray goes on.
    pub fn is_over(&self) -> bool {
        self.active.is_empty()
    }

    /// The next live samples of each ray that goes on, at most `most` of each. The result does not
    /// depend on the number of threads.
    pub fn wave(&mut self, most: usize) -> Samples {
        let candidates = self.candidates;
        let blocks: Vec<Samples> = self
            .active
            .par_chunks_mut(BLOCK)
            .map(|rays| {
                let mut live = Samples::default();
                for ray in rays {
                    candidates.advance(ray, most, &mut live);
                }
                live
            })
            .collect();
        self.active.retain(|ray| ray.next < ray.end);
        let mut samples = Samples {
            rays: candidates.rays,
            per_ray: candidates.per_ray,
            ..Samples::default()
        };
        for block in blocks {
            samples.append(block);
        }
        samples
    }

    /// Ends the walk along rays for which `continues` is false.
    pub fn keep(&mut self, continues: impl Fn(usize) -> bool) {
        self.active.retain(|stretch| continues(stretch.ray));
    }
}

impl Candidates<'_> {
    /// Adds the next live samples of a ray to `live`, at most `most`.
    fn advance(&self, ray: &mut Stretch, most: usize, live: &mut Samples) {
        let mut left = most;
        while left > 0 && ray.next < ray.end {
            let candidate = &self.list[ray.next];
            ray.next += 1;
            if let Some(canonical) = self.canonical(candidate) {
                live.points.extend(candidate.point);
                live.canonical.extend(canonical);
                live.likelihoods.push(candidate.likelihood);
                live.steps.push(candidate.step);
                live.depths.push(candidate.depth);
                live.places.push(candidate.place);
                left -= 1;
            }
        }
    }

    /// The canonical point of a candidate; `None` if it is in a cell that is known to be empty.
    fn canonical(&self, candidate: &Candidate) -> Option<[f32; 3]> {
        // Without a search, the cell of the blend was looked up before.
        let Some(skinning) = &self.skinning else {
            return Some(candidate.blend);
        };
        let found = skinning.search(candidate.point, candidate.blend);
        let canonical = found.unwrap_or(candidate.blend);
        let (occupancy, step) = (self.volume.occupancy, self.volume.step);
        occupancy
            .is_none_or(|grid| grid.admits(canonical, step))
            .then_some(canonical)
    }
}
