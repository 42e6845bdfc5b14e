//! Levels of detail of a person of splats: fewer splats, each in place of a group of near ones of the same part of the
//! body.
//!
//! Groups grow pair by pair as Ward's clusters do (Ward, "Hierarchical grouping to optimize an objective function", 1963):
//! next are always the two whose union adds least to the squared differences within groups, weighted by area. A
//! group becomes the Gaussian of its moments.

mod clusters;
mod moments;

pub(super) use clusters::groups;
pub(super) use moments::merged;

use yoto_ops::splat::{MIN_ALPHA, ROW};

/// A Gaussian in the rest pose, of any source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LevelSplat {
    /// Metres.
    pub mean: [f32; 3],
    /// Unit quaternion, real part first; the third axis is the surface's normal.
    pub turn: [f32; 4],
    /// Standard deviations along the rotated axes, metres.
    pub deviations: [f32; 3],
    /// 0 to 1, at the centre.
    pub opacity: f32,
    pub colour: [f32; 3],
    /// The bone with the largest share.
    pub bone: u16,
}

impl LevelSplat {
    /// The splat of a row of numbers, of which `bone` has the largest share.
    pub fn of_row(row: &[f32; ROW], bone: u16) -> Self {
        let [x, y, z, a, b, c, d, scales @ .., opacity, red, green, blue] = *row;
        // In double precision, squares of single precision neither overflow nor vanish.
        let turn = [a, b, c, d].map(f64::from);
        let length = turn.iter().map(|q| q * q).sum::<f64>().sqrt();
        Self {
            mean: [x, y, z],
            turn: turn.map(|q| (q / length.max(f64::MIN_POSITIVE)) as f32),
            deviations: scales.map(f32::exp),
            opacity: 1.0 / (1.0 + (-opacity).exp()),
            colour: [red, green, blue],
            bone,
        }
    }

    /// The row of numbers: the inverse of [`Self::of_row`].
    pub fn to_row(self) -> [f32; ROW] {
        let [x, y, z] = self.mean;
        let [a, b, c, d] = self.turn;
        let [first, second, third] = self.deviations.map(f32::ln);
        let logit = (self.opacity / (1.0 - self.opacity)).ln();
        let [red, green, blue] = self.colour;
        [
            x, y, z, a, b, c, d, first, second, third, logit, red, green, blue,
        ]
    }

    /// Whether the renderer draws it, where its harmonics are finite too.
    pub fn is_visible(&self) -> bool {
        let numbers = self.mean.iter().chain(&self.turn).chain(&self.deviations);
        let mut numbers = numbers.chain(&self.colour);
        self.opacity > MIN_ALPHA && numbers.all(|number| number.is_finite())
    }

    /// Opacity times the area of the two largest deviations, metres²: what the splat covers when it is seen from the front.
    fn weight(&self) -> f64 {
        let [a, b, c] = self.deviations.map(f64::from);
        f64::from(self.opacity) * (a * b).max(b * c).max(c * a)
    }
}

/// Number of splats of a level, of `all` that can be seen: at least one, unless there are none.
pub(super) fn count(all: usize, share: f32) -> usize {
    let wanted = (all as f64 * f64::from(share)).round() as usize;
    wanted.max(1).min(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quaternions_of_any_length_turn_a_splat_alike() {
        let of = |factor: f32| {
            let mut row = [0.0; ROW];
            row[3..7].copy_from_slice(&[0.5 * factor, -0.5 * factor, 0.5 * factor, 0.5 * factor]);
            LevelSplat::of_row(&row, 0).turn
        };
        for factor in [1e-30, 1.0, 1e30] {
            let off = of(factor).into_iter().zip([0.5, -0.5, 0.5, 0.5]);
            off.for_each(|(a, b)| assert!((a - b).abs() < 1e-6, "{factor:e}: {a}, not {b}"));
        }
        assert_eq!(of(0.0), [0.0; 4]);
    }

    #[test]
    fn a_splat_survives_its_row() {
        let row = [
            0.1, -0.2, 0.3, 0.5, -0.5, 0.5, 0.5, -4.0, -5.0, -6.0, 0.7, 0.2, 0.4, 0.6,
        ];
        let back = LevelSplat::of_row(&row, 3).to_row();
        let pairs = back.iter().zip(row);
        pairs.for_each(|(a, b)| assert!((a - b).abs() < 1e-5, "{back:?}"));
    }
}
