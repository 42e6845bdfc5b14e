//! The closed surface through splats. Signed distances from their planes, weighted by proximity (implicit moving
//! least squares; Kolluri, "Provably good moving least squares", 2005), are summed on a grid, and surface nets
//! extract their zero set.

use super::cloud::Cloud;
use fast_surface_nets::ndshape::RuntimeShape;
use fast_surface_nets::{SurfaceNetsBuffer, surface_nets};
use std::collections::VecDeque;

/// Width of a cell of the grid, metres.
const CELL: f32 = 0.006;
/// Standard deviation of a plane's weight across it, and the least one along it, metres (docs/use/export.md).
const SPREAD: f32 = 0.012;
/// The greatest standard deviation of a plane's weight along it, metres.
const WIDEST: f32 = 0.02;
/// Reach of a plane, standard deviations.
const REACH: f32 = 2.5;
/// Distance from a splat's plane to the visible surface, in standard deviations across the splat: splats have a
/// thickness (docs/use/export.md).
pub(super) const OUTWARD: f32 = 1.5;
/// Least weight of planes that define a distance: that of one splat 1.5 standard deviations away.
const BELIEVED: f32 = 0.3;
/// Widest gap between planes that the surface closes, metres: skin that no frame shows. Closing wider gaps would
/// join separate parts (docs/use/export.md).
const GAP: f32 = 0.024;
/// Most cells of the grid: five times those of a tall person.
const MOST: usize = 60_000_000;
/// Most cells along a side.
const LONGEST: f32 = 1e5;

/// Triangles with shared corners.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Surface {
    /// Metres.
    pub positions: Vec<[f32; 3]>,
    /// Counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// Signed distances on a grid, in metres, negative inside.
struct Grid {
    low: [f32; 3],
    sides: [usize; 3],
    values: Vec<f32>,
}

/// The surface of the largest solid that `cloud` encloses. It has no triangles if the cloud encloses nothing or is
/// larger than a room.
pub(super) fn surface(cloud: &Cloud) -> Surface {
    let Some(mut grid) = Grid::around(cloud) else {
        return Surface::default();
    };
    grid.sum(cloud);
    grid.close();
    grid.keep_largest();
    let shape = RuntimeShape::<u32, 3>::new(grid.sides.map(|side| side as u32));
    let mut nets = SurfaceNetsBuffer::default();
    surface_nets(
        &grid.values,
        &shape,
        [0; 3],
        grid.sides.map(|side| side as u32 - 1),
        &mut nets,
    );
    let position = |point: &[f32; 3]| std::array::from_fn(|a| grid.low[a] + CELL * point[a]);
    Surface {
        positions: nets.positions.iter().map(position).collect(),
        triangles: nets.indices.as_chunks().0.to_vec(),
    }
}

impl Grid {
    /// An empty grid with room around `cloud`.
    fn around(cloud: &Cloud) -> Option<Self> {
        let bound = |start: f32, choose: fn(f32, f32) -> f32| -> [f32; 3] {
            std::array::from_fn(|a| {
                cloud
                    .discs
                    .iter()
                    .map(|disc| disc.mean[a])
                    .fold(start, choose)
            })
        };
        let (low, high) = (
            bound(f32::INFINITY, f32::min),
            bound(f32::NEG_INFINITY, f32::max),
        );
        let room = GAP + REACH * WIDEST;
        let sides = [0, 1, 2].map(|a| {
            let cells = (high[a] - low[a] + 2.0 * room) / CELL;
            cells.ceil().clamp(1.0, LONGEST) as usize + 1
        });
        let count = sides
            .iter()
            .try_fold(1usize, |count, side| count.checked_mul(*side));
        let count = count.filter(|count| !cloud.discs.is_empty() && *count <= MOST)?;
        Some(Self {
            low: low.map(|value| value - room),
            sides,
            values: vec![f32::NAN; count],
        })
    }

    /// Weighted means of the distances; NaN where no plane is near.
    fn sum(&mut self, cloud: &Cloud) {
        let mut weights = vec![0.0f32; self.values.len()];
        let mut sums = vec![0.0f32; self.values.len()];
        for disc in &cloud.discs {
            let [one, other, _] = disc.deviations;
            let spreads = [
                one.clamp(SPREAD, WIDEST),
                other.clamp(SPREAD, WIDEST),
                SPREAD,
            ];
            let out = OUTWARD * disc.deviations[2];
            let reach = REACH * spreads[0].max(spreads[1]);
            let first =
                [0, 1, 2].map(|a| ((disc.mean[a] - reach - self.low[a]) / CELL).max(0.0) as usize);
            let last = [0, 1, 2].map(|a| {
                (((disc.mean[a] + reach - self.low[a]) / CELL) as usize + 1).min(self.sides[a] - 1)
            });
            for k in first[2]..=last[2] {
                for j in first[1]..=last[1] {
                    for i in first[0]..=last[0] {
                        let point = [i, j, k];
                        let point = std::array::from_fn(|a| self.low[a] + CELL * point[a] as f32);
                        let local = disc.local(point);
                        let square: f32 = (0..3).map(|a| (local[a] / spreads[a]).powi(2)).sum();
                        if square < REACH * REACH {
                            let weight = disc.opacity * (-0.5 * square).exp();
                            let at = i + self.sides[0] * (j + self.sides[1] * k);
                            weights[at] += weight;
                            sums[at] += weight * (local[2] - out);
                        }
                    }
                }
            }
        }
        for ((value, weight), sum) in self.values.iter_mut().zip(weights).zip(sums) {
            if weight > BELIEVED {
                *value = sum / weight;
            }
        }
    }

    /// Gives every cell a value. Cells that a ball of the gap's width reaches from the border are outside. Other
    /// cells without a plane are on the side of the nearest cell with one, so that legs stay apart and gaps are
    /// closed. Bubbles inside are filled.
    fn close(&mut self) {
        let cells = (0.5 * GAP / CELL).ceil() as u32;
        let solid = self.cells(|value| value <= 0.0);
        let from_solid = self.distances(&solid, cells);
        let free = self.flood(0, |at| from_solid[at] > cells);
        let mut queue: VecDeque<usize> = self.cells(|value| !value.is_nan()).into();
        for at in &free {
            if self.values[*at].is_nan() {
                self.values[*at] = CELL;
                queue.push_back(*at);
            }
        }
        while let Some(at) = queue.pop_front() {
            for next in self.neighbours(at) {
                if self.values[next].is_nan() {
                    self.values[next] = CELL.copysign(self.values[at]);
                    queue.push_back(next);
                }
            }
        }
        let mut outside = vec![false; self.values.len()];
        for at in self.flood(0, |at| self.values[at] > 0.0) {
            outside[at] = true;
        }
        for (value, outside) in self.values.iter_mut().zip(outside) {
            if !outside {
                *value = -value.abs();
            }
        }
    }

    /// Removes all solids except the largest.
    fn keep_largest(&mut self) {
        let mut seen = vec![false; self.values.len()];
        let mut solids: Vec<Vec<usize>> = Vec::new();
        for start in 0..self.values.len() {
            if self.values[start] <= 0.0 && !seen[start] {
                let solid = self.flood(start, |at| self.values[at] <= 0.0);
                solid.iter().for_each(|at| seen[*at] = true);
                solids.push(solid);
            }
        }
        solids.sort_by_key(Vec::len);
        solids.pop();
        for at in solids.into_iter().flatten() {
            self.values[at] = CELL;
        }
    }

    /// The cells with a value that fulfils `fit`.
    fn cells(&self, fit: impl Fn(f32) -> bool) -> Vec<usize> {
        (0..self.values.len())
            .filter(|at| fit(self.values[*at]))
            .collect()
    }

    /// The cells that can be reached from `start` over `open` cells: a flood fill with a queue, since recursion over
    /// millions of cells would exhaust the stack.
    fn flood(&self, start: usize, open: impl Fn(usize) -> bool) -> Vec<usize> {
        if !open(start) {
            return Vec::new();
        }
        let mut seen = vec![false; self.values.len()];
        seen[start] = true;
        let mut reached = vec![start];
        let mut next = 0;
        while let Some(at) = reached.get(next).copied() {
            next += 1;
            for neighbour in self.neighbours(at) {
                if !seen[neighbour] && open(neighbour) {
                    seen[neighbour] = true;
                    reached.push(neighbour);
                }
            }
        }
        reached
    }

    /// Steps of each cell from the nearest of `starts`; `u32::MAX` beyond `most`.
    fn distances(&self, starts: &[usize], most: u32) -> Vec<u32> {
        let mut distances = vec![u32::MAX; self.values.len()];
        let mut queue: VecDeque<usize> = starts.iter().copied().collect();
        starts.iter().for_each(|at| distances[*at] = 0);
        while let Some(at) = queue.pop_front() {
            let distance = distances[at];
            if distance == most {
                continue;
            }
            for next in self.neighbours(at) {
                if distances[next] == u32::MAX {
                    distances[next] = distance + 1;
                    queue.push_back(next);
                }
            }
        }
        distances
    }

    /// The up to six neighbours of a cell within the grid.
    fn neighbours(&self, at: usize) -> impl Iterator<Item = usize> + use<> {
        let [x, y, z] = self.sides;
        let (i, j, k) = (at % x, at / x % y, at / (x * y));
        let beside = [
            (i > 0).then(|| at - 1),
            (i + 1 < x).then_some(at + 1),
            (j > 0).then(|| at - x),
            (j + 1 < y).then_some(at + x),
            (k > 0).then(|| at - x * y),
            (k + 1 < z).then_some(at + x * y),
        ];
        beside.into_iter().flatten()
    }
}
