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

use yoto_ops::splat::{MIN_ALPHA, SplatRow};

/// A Gaussian in the rest pose, of any source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LevelSplat {
    /// Metres.
    pub mean: [f32; 3],
    /// Unit quaternion, real part first; the third axis is the surface's normal.
    pub rotation: [f32; 4],
    /// Standard deviations along the rotated axes, metres.
    pub deviations: [f32; 3],
    /// 0 to 1, at the centre.
    pub opacity: f32,
    pub colour: [f32; 3],
    /// The bone with the largest share.
    pub bone: u16,
}

impl LevelSplat {
    /// The splat of a row, of which `bone` has the largest share.
    pub(super) fn of_row(row: &SplatRow, bone: u16) -> Self {
        // In double precision, squares of single precision neither overflow nor vanish.
        let rotation = row.rotation.map(f64::from);
        let length = rotation.iter().map(|q| q * q).sum::<f64>().sqrt();
        Self {
            mean: row.mean,
            rotation: rotation.map(|q| (q / length.max(f64::MIN_POSITIVE)) as f32),
            deviations: row.deviations(),
            opacity: row.alpha(),
            colour: row.colour,
            bone,
        }
    }

    /// The row of the splat: the inverse of [`Self::of_row`].
    pub(super) fn to_row(self) -> SplatRow {
        SplatRow {
            mean: self.mean,
            rotation: self.rotation,
            scales: self.deviations.map(f32::ln),
            opacity: (self.opacity / (1.0 - self.opacity)).ln(),
            colour: self.colour,
        }
    }

    /// Whether the renderer draws it, where its harmonics are finite too.
    pub(super) fn is_visible(&self) -> bool {
        let numbers = self
            .mean
            .iter()
            .chain(&self.rotation)
            .chain(&self.deviations);
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
    use yoto_ops::splat::ROW;

    #[test]
    fn quaternions_of_any_length_rotate_a_splat_alike() {
        let of = |factor: f32| {
            let mut row = SplatRow::from([0.0; ROW]);
            row.rotation = [0.5, -0.5, 0.5, 0.5].map(|q| q * factor);
            LevelSplat::of_row(&row, 0).rotation
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
        let back: [f32; ROW] = LevelSplat::of_row(&row.into(), 3).to_row().into();
        let pairs = back.iter().zip(row);
        pairs.for_each(|(a, b)| assert!((a - b).abs() < 1e-5, "{back:?}"));
    }
}
