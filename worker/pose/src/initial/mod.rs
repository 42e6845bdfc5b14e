//! A first guess of every frame, close enough for the search to converge.
//!
//! If the detector guesses depths, [`figure`] reads the stance from its points in space. Otherwise
//! [`headings`] tries several headings and takes those that fit each other. [`position`] finds the body's
//! position in front of the camera.

mod figure;
mod headings;
mod position;

pub(crate) use figure::FACING;

use crate::flips::{has_jumps, steadiest};
use crate::lift::{deepen, own};
use crate::parameters::{Shared, Stance};
use crate::problem::{Observed, Problem};
use crate::solve::improve_frame;
use rayon::prelude::*;

/// Steps that improve the first guess of a single frame.
const STEPS: usize = 6;

/// The stance of a frame from its points in space.
pub(crate) fn read(problem: &Problem, seen: &Observed, shared: &Shared) -> Stance {
    with_cost(problem, seen, shared).0
}

/// The stance of a frame from its points in space, and its cost.
fn with_cost(problem: &Problem, seen: &Observed, shared: &Shared) -> (Stance, f64) {
    let rotations = figure::rotations(problem, seen);
    let stance = position::positioned(problem, seen, shared, rotations);
    improve_frame(problem, seen, &stance, shared, STEPS)
}

/// A stance for every frame, and the number of frames in which the detector mistook back for front; these
/// are corrected in `problem`.
pub(crate) fn stances(problem: &mut Problem, shared: &Shared) -> (Vec<Stance>, usize) {
    if !problem.has_space() {
        return (headings::stances(problem, shared), 0);
    }
    let (stances, turned) = by_space(problem, shared);
    if !problem.lift {
        return (stances, turned);
    }
    deepen(problem, own());
    let frames = problem.frames.par_iter();
    let read = frames.map(|seen| read(problem, seen, shared));
    (read.collect(), turned)
}

/// A stance for every frame from the detector's points in space, and the number of frames in which it mistook back for front.
fn by_space(problem: &mut Problem, shared: &Shared) -> (Vec<Stance>, usize) {
    let read = |seen: &Observed| with_cost(problem, seen, shared);
    let stances: Vec<(Stance, f64)> = problem.frames.par_iter().map(read).collect();
    let times: Vec<f64> = problem.frames.iter().map(|frame| frame.time).collect();
    if !has_jumps(&stances, &times) {
        let stances = stances.into_iter().map(|(stance, _)| stance);
        return (stances.collect(), 0);
    }
    // A detector that mistakes back for front reports the points of the other side, or the body that looks
    // the same and faces the other way.
    let mirror = problem.markers.mirror.clone();
    let others = [Observed::relabelled, Observed::turned_round].map(|other| {
        let frames = problem.frames.par_iter();
        frames.map(|seen| other(seen, &mirror)).collect::<Vec<_>>()
    });
    let [relabelled, round]: [Vec<(Stance, f64)>; 2] =
        [&others[0], &others[1]].map(|frames| frames.par_iter().map(read).collect());
    let choices = stances.into_iter().zip(relabelled).zip(round);
    let choices = choices.map(|((given, relabelled), round)| vec![given, relabelled, round]);
    let (stances, choice) = steadiest(choices.collect(), &times);
    let [relabelled, round] = others;
    let others = relabelled.into_iter().zip(round);
    for ((seen, (relabelled, round)), choice) in problem.frames.iter_mut().zip(others).zip(&choice)
    {
        match choice {
            0 => {}
            1 => *seen = relabelled,
            _ => *seen = round,
        }
    }
    let turned = choice.iter().filter(|choice| **choice > 0).count();
    (stances, turned)
}
