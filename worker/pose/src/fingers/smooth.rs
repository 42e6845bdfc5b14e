//! Angles of a film from those of single frames.

use super::angles::{Angles, NUMBERS};

/// Standard deviation of the time over which angles are averaged, seconds.
const TIME: f64 = 0.07;
/// Time within which the median of the angles is taken, seconds: a frame with a wrong hand differs from its neighbours.
const MEDIAN: f64 = 0.11;
/// Weight of a hand at rest: where no frame near in time shows the hand, it is at rest.
const REST: f64 = 0.05;

/// A hand in one frame.
pub(super) struct Seen {
    pub angles: Angles,
    /// From 0 to 1.
    pub weight: f64,
}

/// The angles in each frame of a film, at these `times`, seconds. They turn into those of a hand at `rest` where the hand is not `seen`.
pub(super) fn smoothed(times: &[f64], seen: &[Option<Seen>], rest: &Angles) -> Vec<Angles> {
    let near = |at: usize, within: f64| {
        let close = move |other: &usize| (times[*other] - times[at]).abs() <= within;
        let before = (0..at).rev().take_while(close);
        before.chain((at..times.len()).take_while(close))
    };
    let medians: Vec<Option<Angles>> = (0..times.len())
        .map(|at| {
            seen[at].as_ref()?;
            let around: Vec<&Seen> = near(at, MEDIAN)
                .filter_map(|it| seen[it].as_ref())
                .collect();
            Some(std::array::from_fn(|i| median(&around, i)))
        })
        .collect();
    (0..times.len())
        .map(|at| {
            let mut sum: Angles = rest.map(|angle| REST * angle);
            let mut weights = REST;
            for other in near(at, 4.0 * TIME) {
                if let (Some(seen), Some(angles)) = (&seen[other], &medians[other]) {
                    let apart = (times[other] - times[at]) / TIME;
                    let weight = seen.weight * (-0.5 * apart * apart).exp();
                    weights += weight;
                    (sum.iter_mut().zip(angles)).for_each(|(sum, angle)| *sum += weight * angle);
                }
            }
            sum.map(|sum| sum / weights)
        })
        .collect()
}

/// The weighted median of one number of hands.
fn median(hands: &[&Seen], number: usize) -> f64 {
    debug_assert!(number < NUMBERS);
    let mut all: Vec<(f64, f64)> = (hands.iter())
        .map(|hand| (hand.angles[number], hand.weight))
        .collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * all.iter().map(|it| it.1).sum::<f64>();
    let mut before = 0.0;
    for (angle, weight) in &all {
        before += weight;
        if before >= half {
            return *angle;
        }
    }
    all.last().map_or(0.0, |it| it.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn film(angle: impl Fn(usize) -> Option<f64>) -> Vec<f64> {
        let times: Vec<f64> = (0..60).map(|at| at as f64 / 30.0).collect();
        let seen: Vec<Option<Seen>> = (0..60)
            .map(|at| {
                angle(at).map(|angle| Seen {
                    angles: [angle; NUMBERS],
                    weight: 0.9,
                })
            })
            .collect();
        let all = smoothed(&times, &seen, &[0.3; NUMBERS]);
        all.into_iter().map(|angles| angles[7]).collect()
    }

    #[test]
    fn a_wrong_frame_does_not_show_and_a_hidden_hand_comes_to_rest() {
        let still = film(|at| (at < 30).then_some(if at == 12 { -2.0 } else { 1.0 }));
        for (at, angle) in still.iter().enumerate() {
            let wanted = if at < 28 { 1.0 } else { 0.3 };
            let is_between = (28..40).contains(&at);
            assert!(is_between || (angle - wanted).abs() < 0.1, "{at}: {angle}");
        }
        // Nothing jumps.
        let jump = still.windows(2).map(|pair| (pair[1] - pair[0]).abs());
        assert!(jump.fold(0.0, f64::max) < 0.25, "{still:?}");
        assert!(
            film(|_| None)
                .iter()
                .all(|angle| (angle - 0.3).abs() < 1e-9)
        );
    }

    #[test]
    fn a_hand_that_moves_is_followed() {
        let truth = |at: usize| 0.8 + 0.6 * (at as f64 / 30.0 * 4.0).sin();
        let found = film(|at| Some(truth(at)));
        for at in 10..50 {
            assert!((found[at] - truth(at)).abs() < 0.1, "{at}");
        }
    }
}
