//! Finds frames whose detector took a body's back for its front, and so left for right.
//!
//! A small picture shows neither, but the motion does: of all readings of the frames, the sequence with
//! plausible rotations is chosen.

use crate::parameters::Stance;
use crate::rotation::{log_map, matmul, transpose};
use yoto_capture::skeleton::transform::length;

/// Highest plausible rotation speed of the root, rad/s.
const FASTEST: f64 = 12.0;
/// Smallest rotation between two frames that counts as a jump, radians.
const LEAST: f64 = 1.5;
/// Cost of a rotation beyond the plausible one, per square radian.
const JUMP: f64 = 1000.0;

/// The cheapest sequence of choices, one per step, by dynamic programming (Viterbi). `costs` are those of
/// each choice, and `change(step, from, to)` is the cost of a transition from `step` to the next.
pub(crate) fn cheapest_run(
    costs: &[Vec<f64>],
    change: impl Fn(usize, usize, usize) -> f64,
) -> Vec<usize> {
    let mut sums: Vec<f64> = costs.first().cloned().unwrap_or_default();
    let mut back: Vec<Vec<usize>> = Vec::new();
    for (step, own) in costs.iter().skip(1).enumerate() {
        let mut origins = Vec::with_capacity(own.len());
        let mut next = Vec::with_capacity(own.len());
        for (to, cost) in own.iter().enumerate() {
            let ways = sums.iter().enumerate();
            let (origin, sum) = ways
                .map(|(from, sum)| (from, sum + change(step, from, to)))
                .min_by(|a, b| a.1.total_cmp(&b.1))
                .unwrap_or((0, 0.0));
            origins.push(origin);
            next.push(sum + cost);
        }
        back.push(origins);
        sums = next;
    }
    let best = sums.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1));
    let mut at = best.map_or(0, |(at, _)| at);
    let mut run = vec![at];
    for origins in back.iter().rev() {
        at = origins.get(at).copied().unwrap_or(0);
        run.push(at);
    }
    run.reverse();
    run.truncate(costs.len());
    run
}

/// The cost of a rotation by `angle` radians in `span` seconds.
pub(crate) fn jump(angle: f64, span: f64) -> f64 {
    JUMP * (angle - FASTEST * span).max(0.0).powi(2)
}

/// Whether the root rotates implausibly fast between any two frames.
pub(crate) fn has_jumps(stances: &[(Stance, f64)], times: &[f64]) -> bool {
    let mut pairs = stances.windows(2).zip(times.windows(2));
    pairs.any(|(pair, span)| match (pair, span) {
        ([(a, _), (b, _)], [from, to]) => angle(a, b) > (FASTEST * (to - from)).max(LEAST),
        _ => false,
    })
}

/// The sequence with plausible rotations among several stances per frame with their costs, and the index of
/// each chosen stance.
pub(crate) fn steadiest(
    choices: Vec<Vec<(Stance, f64)>>,
    times: &[f64],
) -> (Vec<Stance>, Vec<usize>) {
    let costs: Vec<Vec<f64>> = choices
        .iter()
        .map(|ways| ways.iter().map(|(_, cost)| *cost).collect())
        .collect();
    let change = |step: usize, from: usize, to: usize| match (
        choices.get(step..=step + 1),
        times.get(step..=step + 1),
    ) {
        (Some([before, after]), Some([start, end])) => {
            let angle = angle(&before[from].0, &after[to].0);
            jump(angle, end - start)
        }
        _ => 0.0,
    };
    let run = cheapest_run(&costs, change);
    let pick = |(ways, at): (Vec<(Stance, f64)>, &usize)| ways.into_iter().nth(*at);
    let stances = choices.into_iter().zip(&run);
    let stances = stances.filter_map(pick).map(|(stance, _)| stance);
    (stances.collect(), run)
}

/// The angle between two stances' roots, radians.
fn angle(a: &Stance, b: &Stance) -> f64 {
    length(log_map(&matmul(
        &transpose(&a.rotations[0]),
        &b.rotations[0],
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cheapest_run_weighs_choices_against_changes() {
        let costs = vec![vec![0.0, 5.0], vec![1.0, 0.0], vec![0.0, 5.0]];
        let steady = |_, from: usize, to: usize| if from == to { 0.0 } else { 2.0 };
        assert_eq!(cheapest_run(&costs, steady), [0, 0, 0]);
        assert_eq!(cheapest_run(&costs, |_, _, _| 0.0), [0, 1, 0]);
        assert!(cheapest_run(&[], |_, _, _| 0.0).is_empty());
    }
}
