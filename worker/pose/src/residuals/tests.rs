//! Derivatives compared with finite differences.

use super::{Columns, floor, frame, smooth};
use crate::joints::UNKNOWNS;
use crate::options::FitOptions;
use crate::parameters::{ATTACHMENTS, FLOOR, Shared, Stance};
use crate::problem::{Depth, Problem};
use crate::rotation::IDENTITY_ROTATION;
use crate::skeleton::COUNT;
use crate::{FacePoints, FrameKeyPoints, KeyPointSet, KeyPoints};
use yoto_capture::skeleton::transform::rodrigues;

/// Pseudorandom numbers between -1 and 1.
fn wave(at: usize) -> f64 {
    (at as f64 * 12.9898).sin()
}

fn stance(seed: usize) -> Stance {
    let mut stance = Stance {
        rotations: [IDENTITY_ROTATION; COUNT],
        root: [0.1, -0.2, 3.0],
    };
    for (joint, rotation) in stance.rotations.iter_mut().enumerate() {
        let part = |axis: usize| 0.3 * wave(seed + 3 * joint + axis);
        *rotation = rodrigues([part(0), part(1), part(2)]);
    }
    stance.rotations[0] = rodrigues([3.0, 0.2, -0.1]);
    stance
}

fn problem() -> Problem {
    let frame = FrameKeyPoints {
        index: 0,
        picture: (0..33)
            .map(|at| [200.0 + 90.0 * wave(at), 400.0 + 300.0 * wave(at + 50), 0.8])
            .collect(),
        space: (0..33)
            .map(|at| [wave(at), wave(at + 7), wave(at + 13)])
            .collect(),
        face: Some(FacePoints {
            picture: std::array::from_fn(|at| {
                [
                    200.0 + 40.0 * wave(at),
                    100.0 + 40.0 * wave(at + 9),
                    20.0 * wave(at + 17),
                ]
            }),
            lips: [[0.0; 3]; 2],
            eyelids: [[[0.0; 3]; 2]; 2],
            confidence: 0.9,
        }),
        ..FrameKeyPoints::default()
    };
    let points = KeyPoints {
        set: KeyPointSet::BlazePose33,
        image_size: [400, 800],
        fps: 30.0,
        frames: vec![frame],
    };
    Problem::new(&points, &FitOptions::default())
}

/// The gradient of the cost is 2 Jᵀ r, for robust residuals too.
#[test]
fn slopes_of_the_cost_agree_with_differences() {
    let mut problem = problem();
    // Soles are near the floor: one stands still, and those below it count as well.
    problem.floor = Some(0.9);
    problem.frames[0].still = vec![true; 33];
    problem.frames[0].depths = [([13, 15], 0.1, 0.05), ([12, 24], -0.2, 0.2)]
        .map(|(markers, depth, spread)| Depth {
            markers,
            depth,
            spread,
        })
        .to_vec();
    let mut shared = Shared::average(&problem.markers, 700.0);
    for (at, value) in shared.values.iter_mut().enumerate().take(ATTACHMENTS) {
        *value += 0.05 * wave(at);
    }
    let stance = stance(0);
    shared.values[FLOOR] =
        floor::height(&problem, std::slice::from_ref(&stance), &shared).expect("soles");
    let count = shared.values.len();
    let of = |stance: &Stance, shared: &Shared, columns| {
        frame(&problem, &problem.frames[0], stance, shared, columns)
    };
    let rows = of(&stance, &shared, Columns::All(count));
    let width = UNKNOWNS + count;
    let mut slopes = vec![0.0; width];
    for (row, value) in rows.slopes.chunks_exact(width).zip(&rows.values) {
        for (sum, slope) in slopes.iter_mut().zip(row) {
            *sum += 2.0 * slope * value;
        }
    }
    let largest = slopes
        .iter()
        .fold(0.0f64, |most, slope| most.max(slope.abs()));
    for (unknown, &exact) in slopes.iter().enumerate() {
        let cost = |by: f64| {
            let mut step = vec![0.0; width];
            step[unknown] = by;
            let (own, common) = step.split_at(UNKNOWNS);
            of(&stance.moved(own), &shared.moved(common), Columns::Cost).cost
        };
        let slope = (cost(1e-5) - cost(-1e-5)) / 2e-5;
        assert!(
            (slope - exact).abs() < 1e-4 * exact.abs() + 1e-6 * largest,
            "unknown {unknown}: {slope} by differences, {exact} by derivatives"
        );
    }
}

#[test]
fn slopes_of_accelerations_agree_with_differences() {
    let stances = [stance(0), stance(40), stance(90)];
    let times = [0.0, 0.04, 0.1];
    let of = |stances: &[Stance; 3]| {
        let [a, b, c] = stances;
        smooth::accelerations([a, b, c], times).collect::<Vec<_>>()
    };
    for (at, acceleration) in of(&stances).iter().enumerate() {
        for (frame, slopes) in acceleration.slopes.iter().enumerate() {
            for axis in 0..3 {
                let value = |by: f64| {
                    let mut moved = stances.clone();
                    let mut step = vec![0.0; UNKNOWNS];
                    step[acceleration.column + axis] = by;
                    moved[frame] = stances[frame].moved(&step);
                    of(&moved)[at].value
                };
                let (ahead, behind) = (value(1e-5), value(-1e-5));
                for i in 0..3 {
                    let slope = (ahead[i] - behind[i]) / 2e-5;
                    let exact = slopes[i][axis];
                    assert!(
                        (slope - exact).abs() < 1e-4 * exact.abs() + 1e-4,
                        "{at} frame {frame}: {slope} {exact}"
                    );
                }
            }
        }
    }
}
