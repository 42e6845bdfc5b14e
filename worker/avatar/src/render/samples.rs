//! Samples that are evaluated, and their numbers.

use std::ops::AddAssign;

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
    /// Samples that were evaluated: in a cell that is not known to be empty, and not hidden by opaque
    /// samples.
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
        self.evaluated += other.evaluated;
    }
}

impl Samples {
    /// Number of live samples.
    pub fn live(&self) -> usize {
        self.places.len()
    }

    /// The ray of a live sample.
    pub fn ray(&self, sample: usize) -> usize {
        self.places[sample] as usize / self.per_ray
    }

    /// `[R + 1]`: index of each ray's first live sample, followed by their number.
    pub fn starts(&self) -> Vec<usize> {
        let mut starts = Vec::with_capacity(self.rays + 1);
        for sample in 0..self.live() {
            while starts.len() <= self.ray(sample) {
                starts.push(sample);
            }
        }
        starts.resize(self.rays + 1, self.live());
        starts
    }

    /// Adds the samples of `other`, which are those of later rays.
    pub(super) fn append(&mut self, mut other: Self) {
        self.points.append(&mut other.points);
        self.canonical.append(&mut other.canonical);
        self.likelihoods.append(&mut other.likelihoods);
        self.steps.append(&mut other.steps);
        self.depths.append(&mut other.depths);
        self.places.append(&mut other.places);
    }
}
