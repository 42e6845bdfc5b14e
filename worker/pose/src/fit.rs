//! The fit itself: from key points to a pose track.

use crate::check::check;
use crate::options::FitOptions;
use crate::parameters::{FLOOR, Shared, Stance};
use crate::problem::Problem;
use crate::report::Fitted;
use crate::residuals::floor;
use crate::solve::{Guess, improve};
use crate::{KeyPoints, PoseError, colours, expression, fingers, hands, initial, report};

/// Most steps of the search.
const STEPS: usize = 60;
/// Steps that the first guess counts for in the progress.
const GUESS: usize = 10;

/// Fits a moving body to key points, all frames together.
///
/// `progress(done, all)` is called after each step; there are at most `all` steps.
///
/// # Errors
/// [`PoseError`] with the frame and field that can't be fitted.
pub fn fit(
    points: &KeyPoints,
    options: &FitOptions,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Fitted, PoseError> {
    check(points, options)?;
    let all = GUESS + STEPS;
    progress(0, all);
    let mut problem = Problem::new(points, options);
    let mut shared = Shared::average(&problem.markers, problem.focal);
    let (stances, relabelled) = initial::stances(&mut problem, &shared);
    problem.floor = floor::height(&problem, &stances, &shared);
    shared.values[FLOOR] = problem.floor.unwrap_or_default();
    progress(GUESS, all);
    let guess = Guess::new(&problem, stances, shared);
    if !guess.cost.is_finite() {
        return Err(PoseError::Unsolvable);
    }
    let found = improve(&problem, guess, STEPS, &mut |step| {
        progress(GUESS + step, all);
    });
    let (found, round) = face_the_other_way(points, &mut problem, found);
    let found = hands::reread(&problem, found, STEPS);
    progress(all, all);
    let mut fitted = report::fitted(points, options, &problem, &found);
    fitted.hands = fingers::add(points, fitted.focal, &mut fitted.track);
    fitted.face = expression::add(points, &mut fitted.track);
    if relabelled > 0 {
        fitted.notes.push(format!(
            "left and right were taken for each other in {relabelled} frames, by how the body turns"
        ));
    }
    if round > 0 {
        fitted.notes.push(format!(
            "the back was taken for the front in {round} frames, by the colours of head and trunk"
        ));
    }
    Ok(fitted)
}

/// The fit after reversing the frames that have back and front mistaken by their colours, and the number of
/// these frames.
fn face_the_other_way(points: &KeyPoints, problem: &mut Problem, found: Guess) -> (Guess, usize) {
    if !problem.has_space() {
        return (found, 0);
    }
    let heading = |stance: &Stance| {
        // The body's z axis, which points forward, in the camera's axes.
        let ahead = [0, 1, 2].map(|i: usize| stance.rotations[0][i][2]);
        let level = ahead[0].hypot(ahead[2]).max(1e-9);
        [-ahead[2] / level, ahead[0] / level]
    };
    let headings: Vec<[f64; 2]> = found.stances.iter().map(heading).collect();
    let colours: Vec<Vec<[f64; 3]>> = points.frames.iter().map(|it| it.colours.clone()).collect();
    let times: Vec<f64> = problem.frames.iter().map(|frame| frame.time).collect();
    let wrong = colours::wrong(&headings, &colours, &times);
    let count = wrong.iter().filter(|it| **it).count();
    if count == 0 {
        return (found, 0);
    }
    let mirror = problem.markers.mirror.clone();
    let mut stances = found.stances.clone();
    for (at, _) in wrong.iter().enumerate().filter(|(_, wrong)| **wrong) {
        problem.frames[at] = problem.frames[at].turned_round(&mirror);
        stances[at] = initial::read(problem, &problem.frames[at], &found.shared);
    }
    let guess = Guess::new(problem, stances, found.shared);
    (improve(problem, guess, STEPS, &mut |_| ()), count)
}
