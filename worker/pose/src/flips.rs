//! Bodies that were guessed the wrong way round: front to back, and limbs towards the camera that
//! point away from it.
//!
//! A picture tells neither; time does. Each frame has several stances that look alike, and the
//! run of stances that moves least is taken.

use crate::parameters::{Shared, Stance};
use crate::problem::Problem;
use crate::rotation::{logarithm, product, transposed};
use crate::solve::improve_frame;
use rayon::prelude::*;
use std::f64::consts::PI;
use yoto_capture::skeleton::transform::{length, rodrigues};

/// Faster turns of the root are mistakes, rad/s.
const FASTEST: f64 = 12.0;
/// Steps that mend a stance turned round.
const STEPS: usize = 8;
/// What a jump of the root costs by its angle squared.
const JUMP: f64 = 40.0;

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

/// Turns round the bodies of frames that face away from those around them, where the root would
/// have to turn faster than people do.
pub(crate) fn mend_fronts(problem: &Problem, shared: &Shared, stances: &mut Vec<Stance>) {
    let times: Vec<f64> = problem.frames.iter().map(|frame| frame.time).collect();
    let angle = |a: &Stance, b: &Stance| {
        length(logarithm(&product(
            &transposed(&a.rotations[0]),
            &b.rotations[0],
        )))
    };
    let jumps = stances.windows(2).zip(times.windows(2));
    let jumps = jumps.filter(|(pair, span)| match (pair, span) {
        ([a, b], [from, to]) => angle(a, b) > (FASTEST * (to - from)).max(1.5),
        _ => false,
    });
    if jumps.count() == 0 {
        return;
    }
    let both: Vec<[(Stance, f64); 2]> = problem
        .frames
        .par_iter()
        .zip(stances.as_slice())
        .map(|(seen, stance)| {
            let mut round = stance.clone();
            round.rotations[0] = product(&stance.rotations[0], &rodrigues([0.0, PI, 0.0]));
            let mend = |stance: &Stance| improve_frame(problem, seen, stance, shared, STEPS);
            [mend(stance), mend(&round)]
        })
        .collect();
    let costs: Vec<Vec<f64>> = both
        .iter()
        .map(|pair| pair.iter().map(|(_, cost)| *cost).collect())
        .collect();
    let change = |step: usize, from: usize, to: usize| match both.get(step..=step + 1) {
        Some([before, after]) => JUMP * angle(&before[from].0, &after[to].0).powi(2),
        _ => 0.0,
    };
    let run = cheapest_run(&costs, change);
    for ((stance, pair), chosen) in stances.iter_mut().zip(both).zip(run) {
        let [(ahead, _), (round, _)] = pair;
        *stance = if chosen == 0 { ahead } else { round };
    }
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
