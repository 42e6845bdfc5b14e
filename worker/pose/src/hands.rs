//! Hands that the fit tilts the wrong way.
//!
//! A hand is nearly flat and small beside its distance from the camera, so its points show it equally well tilted towards
//! the camera and away from it, and the search stays in the reading that it meets first. Here both are tried in every
//! frame. Of all sequences of readings, the one is chosen that fits the points and priors and turns the hand slowly.

use crate::flips::cheapest_run;
use crate::forward::Posed;
use crate::markers::Markers;
use crate::parameters::Stance;
use crate::problem::Problem;
use crate::rotation::{log_map, matmul, transpose};
use crate::skeleton::parent;
use crate::solve::{Guess, improve, improve_frame};
use rayon::prelude::*;
use yoto_capture::skeleton::transform::{Mat3, length};

/// The two hands: wrist and elbow.
const HANDS: [[usize; 2]; 2] = [[20, 18], [21, 19]];
/// Steps that improve a reading of one frame.
const STEPS: usize = 6;
/// Usual speed of wrists and elbows, rad/s, as in the choice of headings.
const SPEED: f64 = 5.0;
/// Cost of a change of the reading: a hand seen edge-on fits both.
const CHANGE: f64 = 0.3;

/// `guess` after at most `steps` steps from other readings of the hands, if that costs less.
pub(crate) fn reread(problem: &Problem, guess: Guess, steps: usize) -> Guess {
    let mut stances = guess.stances.clone();
    let mut is_same = true;
    for hand in HANDS.into_iter().filter(|hand| has_points(problem, *hand)) {
        let other = other_readings(problem, &guess, hand);
        for (stance, other) in stances.iter_mut().zip(&other) {
            if let Some(other) = other {
                is_same = false;
                for joint in hand {
                    stance.rotations[joint] = other.rotations[joint];
                }
            }
        }
    }
    if is_same {
        return guess;
    }
    let tried = Guess::new(problem, stances, guess.shared.clone());
    let tried = improve(problem, tried, steps, &mut |_| ());
    if tried.cost < guess.cost {
        tried
    } else {
        guess
    }
}

/// Whether key points beyond the wrist show the hand.
fn has_points(problem: &Problem, [wrist, _]: [usize; 2]) -> bool {
    let Markers {
        markers,
        attachments,
        ..
    } = &problem.markers;
    markers.iter().any(|marker| {
        let attachment = attachments.get(marker.attachment);
        let is_beside = attachment.is_some_and(|it| it.offset != [0.0; 3]);
        (marker.joint == wrist && is_beside) || parent(marker.joint) == wrist
    })
}

/// For each frame the stance with the other reading of a hand, where the chosen sequence has it.
fn other_readings(problem: &Problem, guess: &Guess, hand: [usize; 2]) -> Vec<Option<Stance>> {
    let frames = problem.frames.par_iter().zip(&guess.stances);
    let readings: Vec<[(Stance, f64); 2]> = frames
        .map(|(seen, stance)| {
            [stance.clone(), tilted_back(stance, guess, hand)]
                .map(|it| improve_frame(problem, seen, &it, &guess.shared, STEPS))
        })
        .collect();
    let costs: Vec<Vec<f64>> = readings
        .iter()
        .map(|both| both.iter().map(|(_, cost)| *cost).collect())
        .collect();
    let change = |step: usize, from: usize, to: usize| {
        let pair = (readings.get(step), readings.get(step + 1));
        let times = problem.frames.get(step..=step + 1);
        match (pair, times) {
            ((Some(before), Some(after)), Some([a, b])) => {
                let changes = if from == to { 0.0 } else { CHANGE };
                changes + turn(&before[from].0, &after[to].0, hand, b.time - a.time)
            }
            _ => 0.0,
        }
    };
    let run = cheapest_run(&costs, change);
    let chosen = readings.into_iter().zip(run);
    chosen
        .map(|([_, (stance, _)], reading)| (reading == 1).then_some(stance))
        .collect()
}

/// `stance` with the hand that looks the same and is tilted the other way along the view.
fn tilted_back(stance: &Stance, guess: &Guess, [wrist, elbow]: [usize; 2]) -> Stance {
    let posed = Posed::new(stance, &guess.shared);
    let hand = posed.rotations[wrist];
    // The camera's depth changes sign, and so does the axis across the palm, which keeps this a rotation.
    let tilted: Mat3 = std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            if (i == 2) == (j == 1) {
                hand[i][j]
            } else {
                -hand[i][j]
            }
        })
    });
    let mut stance = stance.clone();
    stance.rotations[wrist] = matmul(&transpose(&posed.rotations[elbow]), &tilted);
    stance
}

/// The cost of the rotations of a hand's joints from one stance to the next in `span` seconds.
fn turn(a: &Stance, b: &Stance, hand: [usize; 2], span: f64) -> f64 {
    let usual = SPEED * span + 0.1;
    let cost = |joint: usize| {
        let by = matmul(&transpose(&a.rotations[joint]), &b.rotations[joint]);
        (length(log_map(&by)) / usual).powi(2)
    };
    hand.into_iter().map(cost).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::KeyPointSet;
    use crate::parameters::Shared;
    use crate::rotation::{IDENTITY_ROTATION, matvec};
    use crate::skeleton::COUNT;
    use yoto_capture::skeleton::transform::rodrigues;

    #[test]
    fn a_palm_that_is_tilted_back_keeps_its_outline() {
        let mut stance = Stance {
            rotations: [IDENTITY_ROTATION; COUNT],
            root: [0.0, 0.0, 3.0],
        };
        for (joint, by) in [
            (0, [3.0, 0.2, -0.1]),
            (18, [0.3, -0.9, 0.2]),
            (20, [0.4, 0.1, 0.7]),
        ] {
            stance.rotations[joint] = rodrigues(by);
        }
        let shared = Shared::average(&Markers::of(KeyPointSet::BlazePose33), 1000.0);
        let guess = Guess {
            stances: vec![stance.clone()],
            shared,
            cost: 0.0,
        };
        let tilted = tilted_back(&stance, &guess, HANDS[0]);
        let hand = |stance: &Stance| Posed::new(stance, &guess.shared).rotations[20];
        for on_palm in [[0.08, 0.0, -0.03], [0.09, 0.0, 0.02]] {
            let [x, y, z] = matvec(&hand(&stance), on_palm);
            let back = matvec(&hand(&tilted), on_palm);
            let off = [back[0] - x, back[1] - y, back[2] + z];
            assert!(length(off) < 1e-9, "{off:?}");
        }
        let palm = |stance: &Stance| matvec(&hand(stance), [0.0, -1.0, 0.0])[2];
        assert!((palm(&tilted) - palm(&stance)).abs() < 1e-9);
    }
}
