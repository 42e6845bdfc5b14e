//! The points inside the support of a bone, for a block of points at a time: the bone transforms the
//! whole block, coordinate by coordinate, and most points turn out to be outside. This is plain
//! arithmetic on arrays, which the compiler vectorizes with the instructions of the form. No multiplication
//! is fused with an addition, so that the results of all forms are the same bit for bit.

use super::grid::Support;
use crate::form::{Form, Work};

/// Points per block: their coordinates stay in the first-level cache.
pub(super) const BLOCK: usize = 512;

/// A block of points, before and after the transform of a bone. Numbers past the last point are not
/// read.
pub(super) struct PointBlock {
    count: usize,
    from: [[f32; BLOCK]; 3],
    to: [[f32; BLOCK]; 3],
    /// 1 where the transformed point is in the bone's support, else 0.
    in_support: [u8; BLOCK],
}

impl PointBlock {
    pub(super) fn new() -> Self {
        Self {
            count: 0,
            from: [[0.0; BLOCK]; 3],
            to: [[0.0; BLOCK]; 3],
            in_support: [0; BLOCK],
        }
    }

    /// Replaces the points of the block by at most [`BLOCK`] other points.
    pub(super) fn fill<'a>(&mut self, points: impl Iterator<Item = &'a [f32; 3]>) {
        self.count = 0;
        for (i, point) in points.take(BLOCK).enumerate() {
            for (from, c) in self.from.iter_mut().zip(point) {
                from[i] = *c;
            }
            self.count = i + 1;
        }
    }

    /// Calls `visit` for each point in the support of a bone, in the order of the points, with its
    /// index in the block and its transformed position. `bone` `[12]` is a 3x4
    /// transform, row by row.
    #[inline(always)]
    pub(super) fn for_each_in_support(
        &mut self,
        bone: &[f32],
        support: &Support,
        mut visit: impl FnMut(usize, [f32; 3]),
    ) {
        Form::best().run(TransformBlock {
            block: self,
            bone,
            support,
        });
        for (group, in_support) in self.in_support[..self.count.next_multiple_of(8)]
            .as_chunks::<8>()
            .0
            .iter()
            .enumerate()
        {
            if u64::from_ne_bytes(*in_support) == 0 {
                continue;
            }
            for i in (8 * group..self.count.min(8 * group + 8)).filter(|i| self.in_support[*i] != 0)
            {
                visit(i, std::array::from_fn(|a| self.to[a][i]));
            }
        }
    }
}

/// Fills `to` and `in_support` of a block.
struct TransformBlock<'a> {
    block: &'a mut PointBlock,
    bone: &'a [f32],
    support: &'a Support,
}

impl Work for TransformBlock<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        let block = self.block;
        let count = block.count.next_multiple_of(8).min(BLOCK);
        let [xs, ys, zs] = &block.from;
        let (xs, ys, zs) = (&xs[..count], &ys[..count], &zs[..count]);
        let in_support = &mut block.in_support[..count];
        in_support.fill(1);
        let rows = self.bone.as_chunks::<4>().0;
        for (a, to) in block.to.iter_mut().enumerate() {
            let (low, high) = (self.support.min[a], self.support.max[a]);
            let [tx, ty, tz, shift] = rows[a];
            let to = &mut to[..count];
            for i in 0..count {
                // p = R x + t
                let p = tx * xs[i] + ty * ys[i] + tz * zs[i] + shift;
                to[i] = p;
                // Comparisons are false for a NaN.
                in_support[i] &= u8::from(p > low) & u8::from(p < high);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bone's 3x4 transform applied to a point.
    fn transformed(t: &[f32], x: &[f32; 3]) -> [f32; 3] {
        std::array::from_fn(|r| {
            t[4 * r] * x[0] + t[4 * r + 1] * x[1] + t[4 * r + 2] * x[2] + t[4 * r + 3]
        })
    }

    /// Numbers in ±1 with digits in every place.
    fn number(i: usize) -> f32 {
        ((i as f32 * 12.9898).sin() * 43_758.547).fract()
    }

    #[test]
    fn blocks_of_any_length_visit_the_points_that_are_inside_one_by_one() {
        let bone: Vec<f32> = (0..12).map(number).collect();
        let support = Support {
            min: [-1.2, -1.0, -1.1],
            max: [0.9, 1.1, 1.0],
        };
        let points: Vec<[f32; 3]> = (0..BLOCK)
            .map(|i| match i % 50 {
                49 => [f32::NAN, 0.0, 0.0],
                _ => std::array::from_fn(|a| number(3 * i + a + 100)),
            })
            .collect();
        let mut block = PointBlock::new();
        let mut seen = 0;
        for count in [BLOCK, 0, 1, 7, 8, 9, 300] {
            block.fill(points[..count].iter());
            let mut visited = Vec::new();
            block.for_each_in_support(&bone, &support, |i, p| visited.push((i, p)));
            let expected: Vec<(usize, [f32; 3])> = points[..count]
                .iter()
                .map(|point| transformed(&bone, point))
                .enumerate()
                .filter(|(_, p)| support.contains(*p))
                .collect();
            assert_eq!(visited, expected, "{count} points");
            seen += visited.len();
            let best = (block.to, block.in_support);
            for form in Form::of_loops() {
                form.run(TransformBlock {
                    block: &mut block,
                    bone: &bone,
                    support: &support,
                });
                assert_eq!(best.1, block.in_support, "{}", form.name());
                let bits = |to: &[[f32; BLOCK]; 3]| to.map(|row| row.map(f32::to_bits));
                assert_eq!(bits(&best.0), bits(&block.to), "{}", form.name());
            }
        }
        assert!(seen > 200, "only {seen} points in the support");
    }
}
