//! Axis-aligned boxes around points.

use super::Vec3;

/// A ray with a smaller direction component along an axis is parallel to the box's sides across that axis.
const PARALLEL: f64 = 1e-9;

/// An axis-aligned box, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Lowest corner.
    pub min: Vec3,
    /// Highest corner.
    pub max: Vec3,
}

impl Bounds {
    /// The smallest box around `points`, grown by `margin` on every side. The box of no points is
    /// inside out (lowest corner +∞, highest -∞), and no ray meets it.
    pub fn around(points: &[Vec3], margin: f64) -> Self {
        let extreme = |axis: usize, pick: fn(f64, f64) -> f64, start: f64| {
            points.iter().map(|p| p[axis]).fold(start, pick)
        };
        Self {
            min: std::array::from_fn(|a| extreme(a, f64::min, f64::INFINITY) - margin),
            max: std::array::from_fn(|a| extreme(a, f64::max, f64::NEG_INFINITY) + margin),
        }
    }

    /// The distances at which the ray from `origin` enters and leaves the box, as multiples of
    /// `direction`; it enters at 0 if the origin is inside. `None` if the ray misses the box or has no
    /// direction. Axes with a NaN are ignored.
    pub fn cut(&self, origin: Vec3, direction: Vec3) -> Option<(f64, f64)> {
        let (mut near, mut far) = (0.0f64, f64::INFINITY);
        for (axis, along) in direction.into_iter().enumerate() {
            let low = self.min[axis] - origin[axis];
            let high = self.max[axis] - origin[axis];
            if along.abs() < PARALLEL {
                if low > 0.0 || high < 0.0 {
                    return None;
                }
                continue;
            }
            let (one, other) = (low / along, high / along);
            near = near.max(one.min(other));
            far = far.min(one.max(other));
        }
        // A ray without a direction, or with NaN alone, is cut by no axis and would be endless.
        (near < far && far.is_finite()).then_some((near, far))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_are_cut_where_they_cross_the_sides() {
        let bounds = Bounds::around(&[[0.0; 3], [1.0, 2.0, 3.0]], 0.5);
        let cut = |origin, direction| bounds.cut(origin, direction);
        assert_eq!(cut([-1.5, 0.0, 0.0], [0.5, 0.0, 0.0]), Some((2.0, 6.0)));
        assert_eq!(cut([0.0; 3], [0.0, 1.0, 0.0]), Some((0.0, 2.5)), "inside");
        assert_eq!(cut([-1.5, 0.0, 0.0], [-1.0, 0.0, 0.0]), None, "behind");
        assert_eq!(cut([-1.5, 3.0, 0.0], [1.0, 0.0, 0.0]), None, "beside");
        assert_eq!(cut([0.0; 3], [0.0; 3]), None, "no direction");
        assert_eq!(cut([0.0, f64::NAN, 0.0], [1.0, 1.0, 0.0]), Some((0.0, 1.5)));
        assert_eq!(
            Bounds::around(&[], 0.5).cut([0.0; 3], [1.0, 2.0, 3.0]),
            None
        );
    }
}
