//! Splitting splats: each is replaced by two halves along its longest axis, which know its colour and opacity.
//! So a model gains detail where it needs it and loses nothing that it has learned.

use crate::field::splats::{BONES, HIDDEN, SplatValues};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Distance of a half's middle from that of the whole, in standard deviations of the whole.
const APART: f32 = 0.7;
/// Standard deviation of a half along the axis, as a share of the whole's: the variance of both together
/// is that of the whole.
const NARROWER: f32 = 0.714_142_84;

/// A splat that may be split, ordered by what splitting it is worth; equals by their index, so that the
/// order is one.
struct Candidate {
    worth: f64,
    index: usize,
}

impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> Ordering {
        let by_worth = self.worth.total_cmp(&other.worth);
        by_worth.then_with(|| other.index.cmp(&self.index))
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Candidate {}

/// Splits those splats that are drawn and `worth` `[N]` most until `count` are drawn, in the rows of hidden
/// ones. A half is worth half. Returns for each row the row that its values come from.
pub(super) fn split(splats: &mut SplatValues, worth: &[f64], count: usize) -> Vec<usize> {
    let rows = splats.opacities.len();
    let mut from: Vec<usize> = (0..rows).collect();
    let is_drawn = |index: &usize| splats.opacities[*index] != HIDDEN;
    let (drawn, hidden): (Vec<usize>, Vec<usize>) = (0..rows).partition(is_drawn);
    let missing = count.min(rows).saturating_sub(drawn.len());
    let candidates = drawn.into_iter().map(|index| Candidate {
        worth: worth[index],
        index,
    });
    let mut heap: BinaryHeap<Candidate> = candidates.collect();
    for row in hidden.into_iter().take(missing) {
        let Some(Candidate { worth, index }) = heap.pop() else {
            break;
        };
        splats.halve(index, row);
        from[row] = from[index];
        for index in [index, row] {
            let worth = worth / 2.0;
            heap.push(Candidate { worth, index });
        }
    }
    from
}

impl SplatValues {
    /// Replaces the splat `whole` by two halves along its longest axis, of which the second has the row `other`.
    fn halve(&mut self, whole: usize, other: usize) {
        let scales = self.row::<3>(&self.scales, whole);
        let longest = (0..3).max_by(|a, b| scales[*a].total_cmp(&scales[*b]));
        let axis = longest.unwrap_or(0);
        let along = axis_of(self.row(&self.rotations, whole), axis);
        let step = APART * scales[axis].exp();
        let mean: [f32; 3] = self.row(&self.means, whole);
        let mut halved = scales;
        halved[axis] += NARROWER.ln();
        let rotation: [f32; 4] = self.row(&self.rotations, whole);
        let colour: [f32; 3] = self.row(&self.colours, whole);
        for (row, side) in [(whole, -step), (other, step)] {
            let moved: [f32; 3] = std::array::from_fn(|a| mean[a] + side * along[a]);
            self.means[3 * row..3 * row + 3].copy_from_slice(&moved);
            self.scales[3 * row..3 * row + 3].copy_from_slice(&halved);
            self.rotations[4 * row..4 * row + 4].copy_from_slice(&rotation);
            self.colours[3 * row..3 * row + 3].copy_from_slice(&colour);
        }
        self.opacities[other] = self.opacities[whole];
        if let Some(skinning) = &mut self.skinning {
            for values in [&mut skinning.bones, &mut skinning.weights] {
                values.copy_within(BONES * whole..BONES * (whole + 1), BONES * other);
            }
        }
    }

    fn row<const N: usize>(&self, values: &[f32], row: usize) -> [f32; N] {
        std::array::from_fn(|c| values[N * row + c])
    }
}

/// Column `axis` of the rotation matrix of the quaternion `[w, x, y, z]`, of any length but 0.
fn axis_of(rotation: [f32; 4], axis: usize) -> [f32; 3] {
    let length = rotation
        .iter()
        .map(|q| q * q)
        .sum::<f32>()
        .sqrt()
        .max(1e-12);
    let [w, x, y, z] = rotation.map(|q| q / length);
    match axis {
        0 => [
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y + w * z),
            2.0 * (x * z - w * y),
        ],
        1 => [
            2.0 * (x * y - w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z + w * x),
        ],
        _ => [
            2.0 * (x * z + w * y),
            2.0 * (y * z - w * x),
            1.0 - 2.0 * (x * x + y * y),
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three splats along x, of which the second is rotated by a quarter about z, and `hidden` ones.
    fn three(hidden: usize) -> SplatValues {
        let half = std::f32::consts::FRAC_1_SQRT_2;
        let scales = [0.02f32, 0.01, 0.002].map(f32::ln);
        SplatValues {
            means: vec![0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.2, 0.0, 0.0],
            rotations: [
                [1.0, 0.0, 0.0, 0.0],
                [half, 0.0, 0.0, half],
                [2.0, 0.0, 0.0, 0.0],
            ]
            .concat(),
            scales: scales.repeat(3),
            opacities: vec![1.0, 2.0, 3.0],
            colours: (0..9u8).map(|c| f32::from(c) / 9.0).collect(),
            skinning: None,
        }
        .padded_to(3 + hidden)
    }

    #[test]
    fn those_with_most_error_are_split_along_their_longest_axis() {
        let before = three(3);
        let mut splats = before.clone();
        let from = split(&mut splats, &[1.0, 3.0, 0.5, 0.0, 0.0, 0.0], 5);
        // 3 becomes 1.5 and 1.5, of which the first is more than 1.
        assert_eq!(from, [0, 1, 2, 1, 1, 5]);
        assert_eq!(splats.opacities, [1.0, 2.0, 3.0, 2.0, 2.0, HIDDEN]);
        let x: Vec<f32> = splats.means.iter().step_by(3).copied().collect();
        assert_eq!([x[0], x[2], x[5]], [0.0, 0.2, 0.0], "the others stay");
        let y = |row: usize| splats.means[3 * row + 1];
        // A quarter about z turns the longest axis from x to y.
        assert!((y(3) - 0.014).abs() < 1e-5, "{}", y(3));
        for row in [1, 3, 4] {
            assert!((x[row] - 0.1).abs() < 0.01, "{x:?}");
            assert_eq!(splats.colours[3 * row..3 * row + 3], before.colours[3..6]);
        }
    }

    #[test]
    fn both_halves_have_the_mean_and_the_variance_of_the_whole() {
        let mut splats = three(1);
        split(&mut splats, &[1.0, 0.0, 0.0, 0.0], 4);
        let x = [splats.means[0], splats.means[9]];
        let narrow = splats.scales[0].exp();
        assert!((x[0] + x[1]).abs() < 1e-7);
        let variance = narrow * narrow + x[0] * x[0];
        assert!((variance.sqrt() - 0.02).abs() < 1e-6, "{variance}");
        assert_eq!(splats.scales[1], 0.01f32.ln(), "the other axes stay");
    }

    #[test]
    fn no_more_are_drawn_than_there_are_rows() {
        let mut splats = three(1);
        let from = split(&mut splats, &[1.0; 4], 10);
        assert_eq!(from, [0, 1, 2, 0]);
        assert!(splats.opacities.iter().all(|logit| *logit != HIDDEN));
        let before = splats.clone();
        assert_eq!(split(&mut splats, &[1.0; 4], 2), [0, 1, 2, 3]);
        assert_eq!(splats, before, "none is taken away");
    }
}
