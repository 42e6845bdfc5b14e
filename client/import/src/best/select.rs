//! Farthest points first, by weight.

/// Marks `count` of the points: first the one with the largest product of weight and distance from the
/// mean, then, again and again, the one with the largest product of weight and distance from the nearest
/// marked point. Among equals the larger weight goes first, then the earlier point.
pub(super) fn farthest(points: &[Vec<f64>], weights: &[f64], count: usize) -> Vec<bool> {
    let mut taken = vec![false; points.len()];
    let centre = mean(points);
    let mut nearest: Vec<f64> = points.iter().map(|point| apart(point, &centre)).collect();
    for round in 0..count.min(points.len()) {
        let mut best: Option<(f64, f64, usize)> = None;
        for (at, ((&far, &weight), _)) in nearest
            .iter()
            .zip(weights)
            .zip(&taken)
            .enumerate()
            .filter(|(_, (_, taken))| !**taken)
        {
            let score = (far * weight, weight);
            if best.is_none_or(|(far, weight, _)| score > (far, weight)) {
                best = Some((score.0, score.1, at));
            }
        }
        let Some((_, _, at)) = best else { break };
        let Some(new) = points.get(at) else { break };
        if let Some(mark) = taken.get_mut(at) {
            *mark = true;
        }
        for (nearest, point) in nearest.iter_mut().zip(points) {
            let far = apart(point, new);
            // The mean was only to begin with.
            *nearest = if round == 0 { far } else { far.min(*nearest) };
        }
    }
    taken
}

fn mean(points: &[Vec<f64>]) -> Vec<f64> {
    let mut sum = vec![0.0; points.first().map_or(0, Vec::len)];
    for point in points {
        for (sum, value) in sum.iter_mut().zip(point) {
            *sum += value / points.len() as f64;
        }
    }
    sum
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b).powi(2));
    squares.sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn indices(points: &[f64], weights: &[f64], count: usize) -> Vec<usize> {
        let points: Vec<Vec<f64>> = points.iter().map(|&it| vec![it]).collect();
        let taken = farthest(&points, weights, count);
        (0..points.len()).filter(|&at| taken[at]).collect()
    }

    #[test]
    fn duplicates_are_taken_last() {
        let points = [0.0, 0.0, 0.0, 1.0, 2.0, 2.0];
        assert_eq!(indices(&points, &[1.0; 6], 3), [0, 3, 4]);
        assert_eq!(
            indices(&points, &[0.5, 1.0, 0.5, 1.0, 0.9, 1.0], 3),
            [1, 3, 5]
        );
        assert_eq!(
            indices(&points, &[0.5, 0.9, 1.0, 1.0, 1.0, 0.8], 5),
            [1, 2, 3, 4, 5]
        );
        assert_eq!(indices(&points, &[1.0; 6], 9).len(), 6);
    }

    #[test]
    fn weight_decides_between_near_points_but_not_between_far_ones() {
        let points = [0.0, 5.0, 5.2, 10.0];
        assert_eq!(indices(&points, &[1.0, 1.0, 0.4, 1.0], 3), [0, 1, 3]);
        assert_eq!(indices(&points, &[1.0, 0.4, 1.0, 1.0], 3), [0, 2, 3]);
        assert_eq!(indices(&points, &[1.0, 1.0, 1.0, 0.9], 2), [0, 3]);
    }
}
