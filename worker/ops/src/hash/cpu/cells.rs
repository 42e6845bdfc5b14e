//! The positions of sixteen points in the cells of one level.

use crate::hash::{HashGrid, Level, PRIMES};

/// Points processed at a time: one 512-bit vector of numbers.
pub(super) const LANES: usize = 16;

/// A number of each of the points.
pub(super) type Lanes = [f32; LANES];

/// Sixteen points, axis by axis.
#[derive(Clone, Copy)]
pub(super) struct Points {
    /// Position in the cube, 0 to 1; a point outside is moved to the border.
    pub unit: [Lanes; 3],
    /// Derivative of `unit` with respect to the point, 1/m: 0 along axes where it was moved.
    pub slope: [Lanes; 3],
}

impl Points {
    /// The points `[n ≤ 16, 3]`, metres. The rest of the lanes hold the point at the origin.
    #[inline(always)]
    pub fn new(points: &[f32], grid: &HashGrid) -> Self {
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

/// The cells that the points lie in.
pub(super) struct Cells {
    /// Rows of the cells' corners, relative to the level's first row: bit 0 of a corner's number is
    /// its x.
    pub rows: [[u32; LANES]; 8],
    /// Offset of the point from the cell's lowest corner, cells.
    pub part: [Lanes; 3],
}

impl Cells {
    /// The cells of `unit` at a level. Every row is one of the level's, whatever `unit` is, even
    /// NaN.
    #[inline(always)]
    pub fn new(unit: &[Lanes; 3], level: &Level) -> Self {
        let cells = level.cells as f32;
        let last = level.cells as i32 - 1;
        let (mut low, mut part) = ([[0u32; LANES]; 3], [[0f32; LANES]; 3]);
        for a in 0..3 {
            for lane in 0..LANES {
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

    /// Share of the corners at `side` of an axis: 0 the lower, 1 the upper one.
    #[inline(always)]
    fn weight(&self, axis: usize, side: usize, lane: usize) -> f32 {
        let part = self.part[axis][lane];
        if side == 1 { part } else { 1.0 - part }
    }

    /// Share of each corner: the eight of a point add up to 1.
    #[inline(always)]
    pub fn shares(&self) -> [Lanes; 8] {
        let mut shares = [[0f32; LANES]; 8];
        for (corner, shares) in shares.iter_mut().enumerate() {
            for (lane, share) in shares.iter_mut().enumerate() {
                *share = self.weight(0, corner & 1, lane)
                    * self.weight(1, corner >> 1 & 1, lane)
                    * self.weight(2, corner >> 2, lane);
            }
        }
        shares
    }

    /// Gradient to the position in cells, given the gradients `to` to the shares of the corners.
    #[inline(always)]
    pub fn slopes(&self, to: &[Lanes; 8]) -> [Lanes; 3] {
        let mut slopes = [[0f32; LANES]; 3];
        for (axis, slopes) in slopes.iter_mut().enumerate() {
            let (b, c) = ([1, 0, 0][axis], [2, 2, 1][axis]);
            for (lane, slope) in slopes.iter_mut().enumerate() {
                for (side_b, side_c) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                    let low = side_b << b | side_c << c;
                    let rise = to[low | 1 << axis][lane] - to[low][lane];
                    *slope += rise * self.weight(b, side_b, lane) * self.weight(c, side_c, lane);
                }
            }
        }
        slopes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_those_of_the_level_and_shares_add_up() {
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
            let shares = cells.shares();
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
                let sum: f32 = shares.iter().map(|share| share[lane]).sum();
                assert!((sum - 1.0).abs() < 1e-5 || lane == 2, "{lane}: {sum}");
            }
        }
    }
}
