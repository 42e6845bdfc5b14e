//! The Pareto front.

/// Indices of the points on the Pareto front, cheapest first, where `cost_and_gain(point)` is (cost, gain):
/// no other point has at most their cost and at least their gain. Of equal points, the first is on
/// the front.
pub fn front<T>(points: &[T], cost_and_gain: impl Fn(&T) -> (f64, f64)) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| {
        let ((cost_a, gain_a), (cost_b, gain_b)) =
            (cost_and_gain(&points[a]), cost_and_gain(&points[b]));
        cost_a.total_cmp(&cost_b).then(gain_b.total_cmp(&gain_a))
    });
    let mut best = f64::NEG_INFINITY;
    order.retain(|&index| {
        let gain = cost_and_gain(&points[index]).1;
        let kept = gain > best;
        best = best.max(gain);
        kept
    });
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_nothing_beats_stays() {
        let points = [
            (3.0, 30.0),
            (1.0, 20.0),
            (2.0, 19.0),
            (1.0, 18.0),
            (2.5, 25.0),
            (4.0, 30.0),
        ];
        assert_eq!(front(&points, |it| *it), [1, 4, 0]);
        assert!(front(&[], |it: &(f64, f64)| *it).is_empty());
    }
}
