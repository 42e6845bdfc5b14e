//! A first guess at every frame, near enough for the search to find the way from there.
//!
//! Where the detector guesses depths, [`figure`] reads the stance off its points in space.
//! Elsewhere [`turns`] tries several ways to face and takes those that fit each other.
//! [`place`] puts a stance before the camera.

mod figure;
mod place;
mod turns;

use crate::parameters::{Shared, Stance};
use crate::problem::Problem;
use rayon::prelude::*;

/// Steps that mend each frame's first guess by itself.
const STEPS: usize = 6;

/// A stance for every frame.
pub(crate) fn stances(problem: &Problem, shared: &Shared) -> Vec<Stance> {
    if !problem.has_space() {
        return turns::stances(problem, shared);
    }
    let mut stances: Vec<Stance> = problem
        .frames
        .par_iter()
        .map(|seen| {
            let rotations = figure::rotations(problem, seen);
            let stance = place::placed(problem, seen, shared, rotations);
            crate::solve::improve_frame(problem, seen, &stance, shared, STEPS).0
        })
        .collect();
    crate::flips::mend_fronts(problem, shared, &mut stances);
    stances
}
