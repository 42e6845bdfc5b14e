//! A first guess at every frame, near enough for the search to find the way from there.
//!
//! Where the detector guesses depths, [`figure`] reads the stance off its points in space.
//! Elsewhere [`turns`] tries several ways to face and takes those that fit each other.
//! [`place`] puts a stance before the camera.

mod figure;
mod place;
mod turns;

use crate::flips::{has_jumps, steadiest};
use crate::parameters::{Shared, Stance};
use crate::problem::{Observed, Problem};
use crate::solve::improve_frame;
use rayon::prelude::*;

/// Steps that mend each frame's first guess by itself.
const STEPS: usize = 6;

/// A stance for every frame, and in how many of them left and right were called by each other's
/// name, which is mended in `problem`.
pub(crate) fn stances(problem: &mut Problem, shared: &Shared) -> (Vec<Stance>, usize) {
    if !problem.has_space() {
        return (turns::stances(problem, shared), 0);
    }
    let read = |seen: &Observed| {
        let rotations = figure::rotations(problem, seen);
        let stance = place::placed(problem, seen, shared, rotations);
        improve_frame(problem, seen, &stance, shared, STEPS)
    };
    let stances: Vec<(Stance, f64)> = problem.frames.par_iter().map(read).collect();
    let times: Vec<f64> = problem.frames.iter().map(|frame| frame.time).collect();
    if !has_jumps(&stances, &times) {
        let stances = stances.into_iter().map(|(stance, _)| stance);
        return (stances.collect(), 0);
    }
    let mirror = problem.markers.mirror.clone();
    let relabelled: Vec<Observed> = problem
        .frames
        .par_iter()
        .map(|seen| seen.relabelled(&mirror))
        .collect();
    let others: Vec<(Stance, f64)> = relabelled.par_iter().map(read).collect();
    let choices = stances.into_iter().zip(others).map(|(a, b)| [a, b]);
    let (stances, is_other) = steadiest(choices.collect(), &times);
    let frames = problem.frames.iter_mut().zip(relabelled);
    for ((seen, other), _) in frames.zip(&is_other).filter(|(_, is_other)| **is_other) {
        *seen = other;
    }
    (
        stances,
        is_other.iter().filter(|is_other| **is_other).count(),
    )
}
