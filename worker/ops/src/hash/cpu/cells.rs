//! The positions of sixteen points in the cells of one level.

use crate::hash::{HashGrid, Level, PRIMES};

/// Points processed at a time: one 512-bit vector of numbers.
pub(super) const LANES: usize = 16;

/// One number per point.
pub(super) type Lanes = [f32; LANES];

/// Sixteen points, axis by axis.
#[derive(Clone, Copy)]
pub(super) struct Points {
    /// Position in the cube, 0 to 1; points outside are clamped to the border.
    pub unit: [Lanes; 3],
    /// Derivative of `unit` with respect to the point, 1/m: 0 along axes where it was clamped.
    pub slope: [Lanes; 3],
}

impl Points {
    /// The points `[n, 3]`, metres, n ≤ 16. The remaining lanes hold the origin.
    #[inline(always)]
    pub(super) fn new(points: &[f32], grid: &HashGrid) -> Self {
        let (mut unit, mut slope) = ([[0f32; LANES]; 3], [[0f32; LANES]; 3]);
        for (lane, point) in points.as_chunks::<3>().0.iter().take(LANES).enumerate() {
            for a in 0..3 {
                unit[a][lane] = point[a];
            }
        }
        for a in 0..3 {
            for lane in 0..LANES {
                let raw = (unit[a][lane] - grid.min[a]) / grid.side;
                let clamped = raw.clamp(0.0, 1.0);
                unit[a][lane] = clamped;
                slope[a][lane] = if raw == clamped { 1.0 / grid.side } else { 0.0 };
            }
        }
        Self { unit, slope }
    }
}

/// The cells of the points.
pub(super) struct Cells {
    /// Rows of the corners, relative to the first row of the level. Bit 0 of a corner's index is x, bit 1 y,
    /// bit 2 z.
    pub rows: [[u32; LANES]; 8],
    /// Offset of the point from the cell's lowest corner, cells.
    pub part: [Lanes; 3],
}

impl Cells {
    /// The cells of `unit` at a level. Every row is inside the level, whatever `unit` is, even NaN.
    #[inline(always)]
    pub(super) fn new(unit: &[Lanes; 3], level: &Level) -> Self {
        let cells = level.cells as f32;
        let last = level.cells as i32 - 1;
        let (mut low, mut part) = ([[0u32; LANES]; 3], [[0f32; LANES]; 3]);
        for a in 0..3 {
            for lane in 0..LANES {
                // The cell is ⌊unit · cells⌋, the offset in it the rest.
                let x = unit[a][lane] * cells;
                // `as` saturates and turns a NaN into 0.
                let node = (x as i32).clamp(0, last);
                low[a][lane] = node as u32;
                part[a][lane] = x - node as f32;
            }
        }
        let n = level.cells + 1;
        let (by_y, by_z) = if level.dense {
            (n, n.wrapping_mul(n))
        } else {
            (PRIMES[0], PRIMES[1])
        };
        let mask = (level.rows as u32).wrapping_sub(1);
        let mut rows = [[0u32; LANES]; 8];
        for (corner, rows) in rows.iter_mut().enumerate() {
            let bit = |axis: u32| corner as u32 >> axis & 1;
            for lane in 0..LANES {
                let x = low[0][lane] + bit(0);
                let y = (low[1][lane] + bit(1)).wrapping_mul(by_y);
                let z = (low[2][lane] + bit(2)).wrapping_mul(by_z);
                rows[lane] = if level.dense {
                    x.wrapping_add(y).wrapping_add(z)
                } else {
                    (x ^ y ^ z) & mask
                };
            }
        }
        Self { rows, part }
    }

    /// Linear weight of the corners at the `side` of an axis: 0 is the lower, 1 the upper one.
    #[inline(always)]
    fn axis_weight(&self, axis: usize, side: usize, lane: usize) -> f32 {
        let part = self.part[axis][lane];
        if side == 1 { part } else { 1.0 - part }
    }

    /// Trilinear weight of each corner, wₓ w_y w_z; the eight of a point sum to 1.
    #[inline(always)]
    pub(super) fn weights(&self) -> [Lanes; 8] {
        let mut weights = [[0f32; LANES]; 8];
        for (corner, weights) in weights.iter_mut().enumerate() {
            for (lane, weight) in weights.iter_mut().enumerate() {
                *weight = self.axis_weight(0, corner & 1, lane)
                    * self.axis_weight(1, corner >> 1 & 1, lane)
                    * self.axis_weight(2, corner >> 2, lane);
            }
        }
        weights
    }

    /// Gradient to the position in cells, from the gradients `to` the weights of the corners. Along x, it is
    /// Σ (to[1, y, z] − to[0, y, z]) w_y w_z over the four edges.
    #[inline(always)]
    pub(super) fn position_gradient(&self, to: &[Lanes; 8]) -> [Lanes; 3] {
        let mut gradient = [[0f32; LANES]; 3];
        for (axis, gradient) in gradient.iter_mut().enumerate() {
            let (b, c) = ([1, 0, 0][axis], [2, 2, 1][axis]);
            for (lane, slope) in gradient.iter_mut().enumerate() {
                for (side_b, side_c) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                    let low = side_b << b | side_c << c;
                    let rise = to[low | 1 << axis][lane] - to[low][lane];
                    *slope += rise
                        * self.axis_weight(b, side_b, lane)
                        * self.axis_weight(c, side_c, lane);
                }
            }
        }
        gradient
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_inside_the_level_and_weights_sum_to_one() {
        let grid = HashGrid::new(5, 3, 1.9, 8, 2, [-1.0, 0.0, 2.0], 2.0);
        assert!(grid.levels[0].dense && !grid.levels[4].dense);
        let mut numbers: Vec<f32> = (0..48)
            .map(|i| (i as f32 * 0.37).sin() * 1.3 + 0.5)
            .collect();
        // On the upper border, far outside, and NaN.
        numbers[..9].copy_from_slice(&[
            1.0,
            2.0,
            4.0,
            1e30,
            -1e30,
            f32::INFINITY,
            f32::NAN,
            0.5,
            3.0,
        ]);
        let points = Points::new(&numbers, &grid);
        for level in &grid.levels {
            let cells = Cells::new(&points.unit, level);
            let weights = cells.weights();
            for lane in 0..LANES {
                for corner in 0..8u32 {
                    let node = std::array::from_fn(|a| {
                        let x = points.unit[a][lane] * level.cells as f32;
                        (x as u32).min(level.cells - 1) + (corner >> a & 1)
                    });
                    let row = cells.rows[corner as usize][lane];
                    assert_eq!(row as usize, level.row(node));
                    assert!((row as usize) < level.rows);
                }
                let sum: f32 = weights.iter().map(|weight| weight[lane]).sum();
                assert!((sum - 1.0).abs() < 1e-5 || lane == 2, "{lane}: {sum}");
            }
        }
    }
}
