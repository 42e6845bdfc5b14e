//! Groups of splats, by Ward's criterion among near ones.

use super::LevelSplat;
use rayon::prelude::*;
use std::collections::HashMap;
use yoto_capture::skeleton::transform::from_quaternion;

/// Distance that counts as much as a difference of 1 in colour, metres; this and the next were chosen by experiment
/// (docs/research/splats-experiments.md).
const NEAR: f64 = 0.2;
/// Weight of the difference of unit normals: light and outlines depend on them.
const NORMALS: f64 = 0.3;
/// Numbers that are compared: position, normal and colour.
const FEATURES: usize = 9;
/// One in this many possible pairs is united in a round, those that cost least: their unions then compete again.
const PER_ROUND: usize = 4;
/// Width of a cell of the search, in mean distances of neighbours.
const CELL: f64 = 2.0;

/// A group while groups grow.
#[derive(Clone)]
struct Cluster {
    /// Weighted mean of the features.
    centre: [f64; FEATURES],
    weight: f64,
    bone: u16,
    members: Vec<usize>,
}

/// Two clusters, and what their union costs.
struct Pair {
    cost: f64,
    ends: [usize; 2],
}

/// Indices of `splats` in at most `count` groups; one for each if there are no more. The same splats give the same
/// groups.
pub(in crate::render) fn groups(splats: &[LevelSplat], count: usize) -> Vec<Vec<usize>> {
    let mut clusters: Vec<Cluster> = splats.iter().enumerate().map(Cluster::of).collect();
    let count = count.max(1);
    // The search widens where no pair is near; in the end pairs may be of different bones.
    let (mut wider, mut across) = (1.0, false);
    while clusters.len() > count {
        let cell = wider * CELL * spacing(&clusters);
        let mut pairs = pairs(&clusters, cell, across);
        if pairs.is_empty() {
            across |= wider > 1e3;
            wider *= 2.0;
            continue;
        }
        pairs.sort_by(|a, b| a.cost.total_cmp(&b.cost).then(a.ends.cmp(&b.ends)));
        let most = pairs.len().div_ceil(PER_ROUND);
        let missing = clusters.len() - count;
        let mut gone = vec![false; clusters.len()];
        let mut taken = vec![false; clusters.len()];
        let mut united = 0;
        for Pair { ends: [a, b], .. } in pairs {
            if united == most.min(missing) {
                break;
            }
            if !taken[a] && !taken[b] {
                (taken[a], taken[b], gone[b]) = (true, true, true);
                let other = clusters[b].clone();
                clusters[a].unite(other);
                united += 1;
            }
        }
        let mut gone = gone.into_iter();
        clusters.retain(|_| !gone.next().unwrap_or(false));
    }
    clusters
        .into_iter()
        .map(|cluster| cluster.members)
        .collect()
}

impl Cluster {
    fn of((index, splat): (usize, &LevelSplat)) -> Self {
        let axes = from_quaternion(splat.rotation.map(f64::from));
        let mut centre = [0.0; FEATURES];
        for a in 0..3 {
            centre[a] = f64::from(splat.mean[a]) / NEAR;
            centre[3 + a] = NORMALS * axes[a][2];
            centre[6 + a] = f64::from(splat.colour[a]);
        }
        Self {
            centre,
            weight: splat.weight().max(f64::MIN_POSITIVE),
            bone: splat.bone,
            members: vec![index],
        }
    }

    /// What the union adds to Σ w |f − mean|² within groups.
    fn cost(&self, other: &Self) -> f64 {
        let apart = self.centre.iter().zip(&other.centre);
        let square: f64 = apart.map(|(a, b)| (a - b) * (a - b)).sum();
        square * self.weight * other.weight / (self.weight + other.weight)
    }

    fn unite(&mut self, other: Self) {
        let sum = self.weight + other.weight;
        let share = other.weight / sum;
        for (own, other) in self.centre.iter_mut().zip(&other.centre) {
            *own += share * (other - *own);
        }
        if other.weight > self.weight {
            self.bone = other.bone;
        }
        self.weight = sum;
        self.members.extend(other.members);
    }

    fn cell(&self, width: f64) -> [i64; 3] {
        std::array::from_fn(|a| (self.centre[a] / width).floor() as i64)
    }
}

/// The usual distance of neighbours on a surface, in units of the features.
fn spacing(clusters: &[Cluster]) -> f64 {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for cluster in clusters {
        for a in 0..3 {
            low[a] = low[a].min(cluster.centre[a]);
            high[a] = high[a].max(cluster.centre[a]);
        }
    }
    let [x, y, z]: [f64; 3] = std::array::from_fn(|a| high[a] - low[a]);
    // The surface of the box around them.
    let surface = 2.0 * (x * y + y * z + z * x);
    (surface / clusters.len() as f64).sqrt().max(1e-9)
}

/// The best pair of each cluster with a near one; no pair comes twice.
fn pairs(clusters: &[Cluster], cell: f64, across: bool) -> Vec<Pair> {
    let mut cells: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
    for (index, cluster) in clusters.iter().enumerate() {
        cells.entry(cluster.cell(cell)).or_default().push(index);
    }
    let best = |a: usize| -> Option<Pair> {
        let own = &clusters[a];
        let [x, y, z] = own.cell(cell);
        let near = (0..27)
            .filter_map(|at| cells.get(&[x + at % 3 - 1, y + at / 3 % 3 - 1, z + at / 9 - 1]));
        let others = near
            .flatten()
            .copied()
            .filter(|b| *b != a && (across || clusters[*b].bone == own.bone));
        let costs = others.map(|b| (own.cost(&clusters[b]), b));
        let (cost, b) = costs.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))?;
        Some(Pair {
            cost,
            ends: [a.min(b), a.max(b)],
        })
    };
    let found: Vec<Option<Pair>> = (0..clusters.len()).into_par_iter().map(best).collect();
    let mut pairs: Vec<Pair> = found.into_iter().flatten().collect();
    pairs.sort_by_key(|pair| pair.ends);
    pairs.dedup_by_key(|pair| pair.ends);
    pairs
}
