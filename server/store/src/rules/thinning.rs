//! Which figures of a training are kept for its curve.
//!
//! Points lie closer together at the beginning, where a curve changes fastest: a point is at least 1/512 of the curve's length
//! after the last one. Where this makes too many, every second one is removed.

/// Most points of one job. A curve on a screen has no more columns.
pub const MOST: usize = 1024;
/// Least length of a curve in distances between its last points.
const DISTANCES: u64 = MOST as u64 / 2;

/// Whether a point at `step` is far enough after the others, whose first and last steps are in `span`.
pub fn is_worth(step: u64, span: Option<(u64, u64)>) -> bool {
    let Some((first, last)) = span else {
        return true;
    };
    let (length, distance) = (last.saturating_sub(first), step.saturating_sub(last));
    distance > 0 && distance.saturating_mul(DISTANCES) >= length
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_dense_at_first_and_in_proportion_later() {
        assert!(is_worth(1, None));
        assert!(!is_worth(5, Some((1, 5))), "the same step");
        assert!(is_worth(101, Some((1, 100))), "each of the first steps");
        assert!(!is_worth(51_250, Some((1, 51_201))));
        assert!(is_worth(51_301, Some((1, 51_201))));
    }
}
