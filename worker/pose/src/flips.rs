//! Bodies that a detector took the wrong way round, their back for their front, and so called
//! left right.
//!
//! A picture of few pixels tells neither; time does: of the ways in which each frame can be read,
//! the run that turns as people can is taken.

use crate::parameters::Stance;
use crate::rotation::{log_map, matmul, transpose};
use yoto_capture::skeleton::transform::length;

/// Faster turns of the root are mistakes, rad/s.
const FASTEST: f64 = 12.0;
/// Smallest turn between two frames that is looked at, radians.
const LEAST: f64 = 1.5;
/// What a turn beyond the fastest costs by its angle squared, radians.
const JUMP: f64 = 1000.0;

/// The choice per step whose own costs and changes add up to the least; `change(step, from, to)`
/// is the cost between `step` and the next.
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

/// What a turn by an angle, radians, in `span` seconds costs.
pub(crate) fn jump(turn: f64, span: f64) -> f64 {
    JUMP * (turn - FASTEST * span).max(0.0).powi(2)
}

/// Whether the root turns faster than people do between any two frames.
pub(crate) fn has_jumps(stances: &[(Stance, f64)], times: &[f64]) -> bool {
    let mut pairs = stances.windows(2).zip(times.windows(2));
    pairs.any(|(pair, span)| match (pair, span) {
        ([(a, _), (b, _)], [from, to]) => turn(a, b) > (FASTEST * (to - from)).max(LEAST),
        _ => false,
    })
}

/// Of several stances a frame with their costs, the ones that turn as people can; the place of each.
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
            let turn = turn(&before[from].0, &after[to].0);
            jump(turn, end - start)
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
fn turn(a: &Stance, b: &Stance) -> f64 {
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
