//! Stances without any guess of depth. At some frames several headings are tried; the chosen sequence of
//! headings fits the points and changes little.

use super::figure::FACING;
use super::position::positioned;
use crate::flips::cheapest_run;
use crate::parameters::{Shared, Stance};
use crate::problem::{Observed, Problem};
use crate::rotation::{IDENTITY_ROTATION, log_map, matmul, slerp, transpose};
use crate::skeleton::COUNT;
use crate::solve::improve_frame;
use rayon::prelude::*;
use std::f64::consts::TAU;
use yoto_capture::skeleton::transform::{Mat3, add, length, rodrigues, scale, sub};

/// Headings that are tried.
const WAYS: usize = 8;
/// Steps of each try.
const STEPS: usize = 15;
/// Seconds between frames that are tried.
const APART: f64 = 0.15;
/// Usual rotation speeds of the root and of other joints, rad/s.
const SPEEDS: [f64; 2] = [2.5, 5.0];

/// A stance for every frame.
pub(super) fn stances(problem: &Problem, shared: &Shared) -> Vec<Stance> {
    let tried = tried(problem);
    let tries: Vec<Vec<(Stance, f64)>> = tried
        .par_iter()
        .filter_map(|&at| problem.frames.get(at))
        .map(|seen| {
            (0..WAYS)
                .map(|way| attempt(problem, seen, shared, way))
                .collect()
        })
        .collect();
    let costs: Vec<Vec<f64>> = tries
        .iter()
        .map(|ways| ways.iter().map(|(_, cost)| *cost).collect())
        .collect();
    let time = |at: usize| problem.frames.get(at).map_or(0.0, |frame| frame.time);
    let change = |step: usize, from: usize, to: usize| {
        let pair = |at: usize, way: usize| tries.get(at).and_then(|ways| ways.get(way));
        let span = match tried.get(step..=step + 1) {
            Some([before, after]) => time(*after) - time(*before),
            _ => return 0.0,
        };
        match (pair(step, from), pair(step + 1, to)) {
            (Some((a, _)), Some((b, _))) => rotation_cost(a, b, span),
            _ => 0.0,
        }
    };
    let run = cheapest_run(&costs, change);
    let chosen: Vec<&Stance> = tries
        .iter()
        .zip(run)
        .filter_map(|(ways, way)| ways.get(way).map(|(stance, _)| stance))
        .collect();
    between_tried(problem, &tried, &chosen)
}

/// The frames that are tried: the first, the last, and some between.
fn tried(problem: &Problem) -> Vec<usize> {
    let mut tried: Vec<usize> = Vec::new();
    let mut next = f64::NEG_INFINITY;
    for (at, frame) in problem.frames.iter().enumerate() {
        if frame.time >= next || at + 1 == problem.frames.len() {
            tried.push(at);
            next = frame.time + APART;
        }
    }
    tried
}

/// The stance of one frame from one heading, improved by itself, and its cost.
fn attempt(problem: &Problem, seen: &Observed, shared: &Shared, way: usize) -> (Stance, f64) {
    let yaw = TAU * way as f64 / WAYS as f64;
    let mut rotations = [IDENTITY_ROTATION; COUNT];
    let facing = matmul(&FACING, &rodrigues([0.0, yaw, 0.0]));
    rotations[0] = matmul(&rodrigues([0.0, 0.0, slant(problem, seen)]), &facing);
    for (joint, lowered) in [(16, -1.1), (17, 1.1)] {
        rotations[joint] = rodrigues([0.0, 0.0, lowered]);
    }
    let stance = positioned(problem, seen, shared, rotations);
    improve_frame(problem, seen, &stance, shared, STEPS)
}

/// Angle of the torso from upright in the picture, radians.
fn slant(problem: &Problem, seen: &Observed) -> f64 {
    let figure = &problem.markers.figure;
    let detection = |point: usize| {
        seen.detections
            .iter()
            .find(|detection| detection.marker == point)
    };
    let middle = |[left, right]: [usize; 2]| {
        let (a, b) = (detection(left)?.pixel, detection(right)?.pixel);
        Some([a[0] + b[0], a[1] + b[1]])
    };
    match (middle(figure.shoulders), middle(figure.hips)) {
        (Some(top), Some(bottom)) => (top[0] - bottom[0]).atan2(bottom[1] - top[1]),
        _ => 0.0,
    }
}

/// The cost of the rotations from one stance to another in `span` seconds.
pub(crate) fn rotation_cost(a: &Stance, b: &Stance, span: f64) -> f64 {
    let angle = |joint: usize| {
        let rotation = log_map(&matmul(
            &transpose(&a.rotations[joint]),
            &b.rotations[joint],
        ));
        length(rotation)
    };
    let cost = |joint: usize, speed: f64| (angle(joint) / (speed * span + 0.1)).powi(2);
    let joints = (1..COUNT).map(|joint| cost(joint, SPEEDS[1])).sum::<f64>();
    4.0 * cost(0, SPEEDS[0]) + joints
}

/// Stances of all frames, interpolated between those of the frames in `tried`.
fn between_tried(problem: &Problem, tried: &[usize], chosen: &[&Stance]) -> Vec<Stance> {
    let mut stances: Vec<Stance> = Vec::with_capacity(problem.frames.len());
    for (ends, pair) in tried.windows(2).zip(chosen.windows(2)) {
        if let ([from, to], [a, b]) = (ends, pair) {
            for at in *from..*to {
                stances.push(mix(a, b, (at - from) as f64 / (to - from) as f64));
            }
        }
    }
    stances.extend(chosen.last().map(|stance| (*stance).clone()));
    stances
}

fn mix(a: &Stance, b: &Stance, share: f64) -> Stance {
    let rotations: [Mat3; COUNT] =
        std::array::from_fn(|joint| slerp(&a.rotations[joint], &b.rotations[joint], share));
    Stance {
        rotations,
        root: add(a.root, scale(sub(b.root, a.root), share)),
    }
}
