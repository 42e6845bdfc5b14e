//! Angles of a film from those of single frames, of a hand or a face.

/// How angles are smoothed.
pub(crate) struct Smoothing<const N: usize> {
    /// Standard deviation of the time over which angles are averaged, seconds.
    pub time: f64,
    /// Time within which the median of the angles is taken, seconds: a frame that is read wrongly differs from its neighbours.
    pub median: f64,
    /// Error of each angle that neighbouring frames share, radians.
    pub error: [f64; N],
}

/// Weight of the usual angles: where no frame near in time shows the part, it is as usual.
const USUAL: f64 = 0.05;
/// Weight of a part at rest in the usual one, in frames.
const REST: f64 = 3.0;

/// A part in one frame, by N angles, radians.
pub(crate) struct Seen<const N: usize> {
    pub angles: [f64; N],
    /// From 0 to 1.
    pub weight: f64,
}

/// The angles in each frame of a film, at these `times`, seconds. Where the part is not `seen` they turn into its usual ones, which are
/// those at `rest` if hardly any frame shows it. An angle that varies no more than the detector errs stays near the usual one: its
/// deviations are multiplied by V / (V + σ²), with its variance V and the detector's error σ.
pub(crate) fn smoothed<const N: usize>(
    times: &[f64],
    seen: &[Option<Seen<N>>],
    rest: &[f64; N],
    how: &Smoothing<N>,
) -> Vec<[f64; N]> {
    let near = |at: usize, within: f64| {
        let close = move |other: &usize| (times[*other] - times[at]).abs() <= within;
        let before = (0..at).rev().take_while(close);
        before.chain((at..times.len()).take_while(close))
    };
    let medians: Vec<Option<[f64; N]>> = (0..times.len())
        .map(|at| {
            seen[at].as_ref()?;
            let around: Vec<&Seen<N>> = near(at, how.median)
                .filter_map(|it| seen[it].as_ref())
                .collect();
            Some(std::array::from_fn(|i| median(&around, i)))
        })
        .collect();
    let at_rest = Seen {
        angles: *rest,
        weight: REST,
    };
    let all: Vec<&Seen<N>> = seen.iter().flatten().chain([&at_rest]).collect();
    let usual: [f64; N] = std::array::from_fn(|i| median(&all, i));
    let mut angles: Vec<[f64; N]> = (0..times.len())
        .map(|at| {
            let mut sum = usual.map(|angle| USUAL * angle);
            let mut weights = USUAL;
            for other in near(at, 4.0 * how.time) {
                if let (Some(seen), Some(angles)) = (&seen[other], &medians[other]) {
                    let apart = (times[other] - times[at]) / how.time;
                    let weight = seen.weight * (-0.5 * apart * apart).exp();
                    weights += weight;
                    (sum.iter_mut().zip(angles)).for_each(|(sum, angle)| *sum += weight * angle);
                }
            }
            sum.map(|sum| sum / weights)
        })
        .collect();
    for number in 0..N {
        let (mut squares, mut weights) = (0.0, 0.0);
        for (angles, seen) in angles.iter().zip(seen) {
            let weight = seen.as_ref().map_or(0.0, |it| it.weight);
            squares += weight * (angles[number] - usual[number]).powi(2);
            weights += weight;
        }
        // A part that is seen a few times alone hardly varies.
        let variance = squares / (weights + REST);
        let share = variance / (variance + how.error[number].powi(2));
        for angles in &mut angles {
            angles[number] = usual[number] + share * (angles[number] - usual[number]);
        }
    }
    angles
}

/// The weighted median of one angle.
fn median<const N: usize>(seen: &[&Seen<N>], number: usize) -> f64 {
    let mut all: Vec<(f64, f64)> = (seen.iter())
        .map(|it| (it.angles[number], it.weight))
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

    /// As fingers are smoothed.
    const HOW: Smoothing<2> = Smoothing {
        time: 0.12,
        median: 0.11,
        error: [0.3; 2],
    };

    fn film(angle: impl Fn(usize) -> Option<f64>) -> Vec<f64> {
        let times: Vec<f64> = (0..60).map(|at| at as f64 / 30.0).collect();
        let seen: Vec<Option<Seen<2>>> = (0..60)
            .map(|at| {
                angle(at).map(|angle| Seen {
                    angles: [0.0, angle],
                    weight: 0.9,
                })
            })
            .collect();
        let all = smoothed(&times, &seen, &[0.3; 2], &HOW);
        all.into_iter().map(|angles| angles[1]).collect()
    }

    #[test]
    fn a_wrong_frame_does_not_show_and_a_hidden_hand_is_as_usual() {
        let still = film(|at| (at < 30).then_some(if at == 12 { -2.0 } else { 1.0 }));
        for (at, angle) in still.iter().enumerate() {
            assert!((angle - 1.0).abs() < 0.1, "{at}: {angle}");
        }
        // Nothing is known of a hand that is never seen, and hardly anything of one that is seen once.
        assert!(
            film(|_| None)
                .iter()
                .all(|angle| (angle - 0.3).abs() < 1e-9)
        );
        let once = film(|at| (at == 30).then_some(1.6));
        assert!(once[10] < 0.35 && once[30] < 1.3, "{once:?}");
    }

    #[test]
    fn a_hand_that_moves_is_followed_and_one_that_trembles_is_not() {
        let truth = |at: usize| 0.8 + 0.7 * (at as f64 / 30.0 * 3.0).sin();
        let found = film(|at| Some(truth(at)));
        for (at, found) in found.iter().enumerate().take(50).skip(10) {
            assert!((found - truth(at)).abs() < 0.3, "{at}: {found}");
        }
        let jump = found.windows(2).map(|pair| (pair[1] - pair[0]).abs());
        assert!(jump.fold(0.0, f64::max) < 0.1, "{found:?}");
        let trembling = film(|at| Some(0.8 + 0.2 * (at as f64 / 30.0 * 6.0).sin()));
        assert!(
            trembling.iter().all(|angle| (angle - 0.8).abs() < 0.06),
            "{trembling:?}"
        );
    }
}
