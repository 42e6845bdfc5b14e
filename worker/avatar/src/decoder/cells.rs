//! The grid of places at which a decoder has values: rings along each part of the body, with equal steps around it.

use super::parts::{BodyPlace, PARTS, Parts};

/// The grid of one part.
#[derive(Clone, Copy)]
struct Grid {
    rings: usize,
    /// Steps around each ring.
    steps: usize,
    /// Where the rings begin and end along the part.
    range: [f32; 2],
}

const fn grid(rings: usize, steps: usize, range: [f32; 2]) -> Grid {
    Grid {
        rings,
        steps,
        range,
    }
}

/// The grid of each part.
const GRIDS: [Grid; PARTS] = {
    let limb = grid(8, 12, [-0.1, 1.1]);
    let end = grid(6, 10, [-0.5, 2.0]);
    let mut grids = [limb; PARTS];
    grids[0] = grid(20, 24, [-0.25, 1.1]);
    grids[1] = grid(14, 20, [-0.1, 1.3]);
    // Hands and feet.
    [grids[6], grids[7], grids[12], grids[13]] = [end; 4];
    grids
};
/// Index of the first cell of each part, and the number of cells last.
const FIRST: [usize; PARTS + 1] = {
    let mut first = [0; PARTS + 1];
    let mut part = 0;
    while part < PARTS {
        first[part + 1] = first[part] + GRIDS[part].rings * GRIDS[part].steps;
        part += 1;
    }
    first
};
/// Number of cells.
pub(crate) const CELLS: usize = FIRST[PARTS];

/// The four cells around a place, with their bilinear weights, which sum to 1.
pub(crate) fn around(place: BodyPlace) -> [(usize, f32); 4] {
    let Grid {
        rings,
        steps,
        range: [low, high],
    } = GRIDS[place.part];
    let ring = (place.along - low) / (high - low) * rings as f32 - 0.5;
    // A NaN is at the start.
    let ring = ring.clamp(0.0, (rings - 1) as f32).max(0.0);
    let below = (ring as usize).min(rings - 1);
    let above = (below + 1).min(rings - 1);
    let step = (place.around * steps as f32 - 0.5).rem_euclid(steps as f32);
    let left = (step as usize) % steps;
    let right = (left + 1) % steps;
    let (up, over) = (ring - below as f32, step - step.floor());
    let cell = |ring: usize, step: usize| FIRST[place.part] + ring * steps + step;
    [
        (cell(below, left), (1.0 - up) * (1.0 - over)),
        (cell(below, right), (1.0 - up) * over),
        (cell(above, left), up * (1.0 - over)),
        (cell(above, right), up * over),
    ]
}

/// The cell on the other side of the body, of each cell.
pub(crate) fn mirrored() -> Vec<usize> {
    let mut mirrored = Vec::with_capacity(CELLS);
    for (part, grid) in GRIDS.into_iter().enumerate() {
        let Grid { rings, steps, .. } = grid;
        let other = Parts::other(part);
        for ring in 0..rings {
            for step in 0..steps {
                let step = if other == part {
                    steps - 1 - step
                } else {
                    step
                };
                mirrored.push(FIRST[other] + ring * steps + step);
            }
        }
    }
    mirrored
}

/// Means of what people have in each cell.
pub(crate) struct Means {
    /// `[CELLS]` sums of the weights.
    pub weights: Vec<f32>,
    /// `[CELLS]` mean colours; 0 where there is nothing.
    pub colours: Vec<[f32; 3]>,
}

impl Means {
    /// The mean at a place, of the cells around it that have a weight; `None` if none has.
    pub(crate) fn at(&self, place: BodyPlace) -> Option<[f32; 3]> {
        let (mut sum, mut total) = ([0.0; 3], 0.0);
        for (cell, share) in around(place) {
            if self.weights[cell] > 0.0 {
                total += share;
                for (sum, value) in sum.iter_mut().zip(self.colours[cell]) {
                    *sum += share * value;
                }
            }
        }
        (total > 0.0).then(|| sum.map(|value| value / total))
    }

    /// The means of colours at places, each with a weight.
    pub(crate) fn of(points: impl Iterator<Item = (BodyPlace, [f32; 3], f32)>) -> Self {
        let mut sums = vec![[0f64; 4]; CELLS];
        for (place, colour, weight) in points {
            for (cell, share) in around(place) {
                let part = f64::from(share * weight);
                for (sum, value) in sums[cell].iter_mut().zip(colour) {
                    *sum += part * f64::from(value);
                }
                sums[cell][3] += part;
            }
        }
        let mean = |[r, g, b, weight]: &[f64; 4]| match *weight > 0.0 {
            true => [r, g, b].map(|sum| (sum / weight) as f32),
            false => [0.0; 3],
        };
        Self {
            weights: sums.iter().map(|sum| sum[3] as f32).collect(),
            colours: sums.iter().map(mean).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(part: usize, along: f32, around: f32) -> BodyPlace {
        BodyPlace {
            part,
            along,
            around,
        }
    }

    #[test]
    fn the_cells_around_a_place_share_it() {
        for part in 0..PARTS {
            for along in [-9.0, -0.1, 0.0, 0.33, 1.0, 9.0, f32::NAN] {
                for turn in [0.0, 0.01, 0.5, 0.99] {
                    let cells = around(place(part, along, turn));
                    let sum: f32 = cells.iter().map(|(_, share)| share).sum();
                    assert!((sum - 1.0).abs() < 1e-5, "{part} {along} {turn}: {cells:?}");
                    let own = FIRST[part]..FIRST[part + 1];
                    assert!(
                        cells
                            .iter()
                            .all(|(cell, share)| own.contains(cell) && *share >= 0.0)
                    );
                }
            }
        }
    }

    #[test]
    fn the_mirror_of_the_mirror_is_the_cell_itself() {
        let mirrored = mirrored();
        assert_eq!(mirrored.len(), CELLS);
        assert!((0..CELLS).all(|cell| mirrored[mirrored[cell]] == cell));
        let left = Means::of([(place(0, 0.5, 0.26), [1.0; 3], 1.0)].into_iter());
        let right = Means::of([(place(0, 0.5, 0.74), [1.0; 3], 1.0)].into_iter());
        for (weight, other) in left.weights.iter().zip(mirrored) {
            assert!((weight - right.weights[other]).abs() < 1e-5);
        }
    }

    #[test]
    fn means_are_weighted() {
        let at = place(3, 0.5, 0.25);
        let means = Means::of([(at, [1.0, 0.0, 0.5], 3.0), (at, [0.0, 1.0, 0.5], 1.0)].into_iter());
        let (cell, _) = around(at)[0];
        assert_eq!(means.colours[cell], [0.75, 0.25, 0.5]);
        assert_eq!(means.colours[0], [0.0; 3]);
    }
}
