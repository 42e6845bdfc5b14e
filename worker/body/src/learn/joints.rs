//! The regressor of joints: each is a mean of vertices around it, with shares that are learned.

use super::nnls;
use super::read::Bodies;
use super::symmetry::distance;
use crate::extra_joints::WITH_FINGERS;
use crate::file::MOST_SHARES;
use faer::Mat;
use rayon::prelude::*;

/// The joint on the other side of each.
pub(crate) const OTHER: [usize; WITH_FINGERS] = [
    0, 2, 1, 3, 5, 4, 6, 8, 7, 9, 11, 10, 12, 14, 13, 15, 17, 16, 19, 18, 21, 20, 23, 22, //
    39, 40, 41, 42, 43, 44, 45, 46, 47, 48, 49, 50, 51, 52, 53, //
    24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38,
];
/// How far around a joint its vertices are looked for, metres. A joint of the back or a hip needs vertices all around
/// the body; one of a hand must not have them.
const REACHES: [f32; 3] = [0.1, 0.2, 0.3];
/// Vertices to choose from.
const CANDIDATES: usize = 200;
/// A farther reach has to be better by this part.
const BETTER: f64 = 0.9;
/// Part of the mean square of a column that is added to the diagonal, so that neighbours are not dependent.
const RIDGE: f64 = 1e-7;

/// The regressor, `[K]`, of bodies with weights; of the fingers' joints too, if the bodies have them.
///
/// Right joints have the partners of the left joints' vertices, and middle joints a vertex and its partner in the same
/// share, so that a symmetric body has symmetric joints.
pub(super) fn learn(
    bodies: &Bodies,
    kept: &[(usize, f64)],
    mean: &[[f32; 3]],
    welded: &[u32],
    mirror: &[u32],
) -> Vec<Vec<(u32, f32)>> {
    let places = bodies.mean_joints(kept);
    let fit = |joint: usize| -> Vec<(u32, f32)> {
        let most = if OTHER[joint] == joint {
            MOST_SHARES / 2
        } else {
            MOST_SHARES
        };
        let mut best: Option<(f64, Vec<(u32, f32)>)> = None;
        for reach in REACHES {
            let chosen = spread(bodies, mean, welded, places[joint], reach);
            let (error, shares) = regressed(bodies, kept, mirror, joint, &chosen, most);
            if best
                .as_ref()
                .is_none_or(|(other, _)| error < BETTER * other)
            {
                best = Some((error, shares));
            }
        }
        best.map(|(_, shares)| shares).unwrap_or_default()
    };
    let count = places.len();
    let fitted: Vec<Vec<(u32, f32)>> = (0..count)
        .into_par_iter()
        .map(|joint| {
            if joint <= OTHER[joint] {
                fit(joint)
            } else {
                Vec::new()
            }
        })
        .collect();
    let partner = |(at, share): &(u32, f32)| (welded[mirror[*at as usize] as usize], *share);
    let joint = |joint: usize| -> Vec<(u32, f32)> {
        let own = &fitted[OTHER[joint].min(joint)];
        if OTHER[joint] > joint {
            return own.clone();
        }
        let partners: Vec<(u32, f32)> = own.iter().map(partner).collect();
        if OTHER[joint] < joint {
            return merged(partners, 1.0);
        }
        merged([own.clone(), partners].concat(), 0.5)
    };
    (0..count).map(joint).collect()
}

/// Shares times `factor`, one per vertex.
fn merged(mut shares: Vec<(u32, f32)>, factor: f32) -> Vec<(u32, f32)> {
    shares.sort_by_key(|(at, _)| *at);
    let mut merged: Vec<(u32, f32)> = Vec::with_capacity(shares.len());
    for (at, share) in shares {
        match merged.last_mut() {
            Some((last, sum)) if *last == at => *sum += factor * share,
            _ => merged.push((at, factor * share)),
        }
    }
    merged
}

/// At most [`CANDIDATES`] vertices within `reach` of a place, far from each other; never fewer than the nearest ones.
fn spread(
    bodies: &Bodies,
    mean: &[[f32; 3]],
    welded: &[u32],
    place: [f32; 3],
    reach: f32,
) -> Vec<u32> {
    let main = |at: &usize| welded[*at] as usize == *at && bodies.topology.part[*at] == 0;
    let mut near: Vec<(f32, u32)> = (0..mean.len())
        .filter(main)
        .map(|at| (distance(mean[at], place), at as u32))
        .collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    let within = near.partition_point(|(off, _)| *off < reach);
    near.truncate(within.max(CANDIDATES));
    let pool: Vec<u32> = near.into_iter().map(|(_, at)| at).collect();
    let mut off = vec![f32::INFINITY; pool.len()];
    let mut chosen = Vec::new();
    let mut next = 0;
    while chosen.len() < CANDIDATES.min(pool.len()) {
        chosen.push(pool[next]);
        for (off, at) in off.iter_mut().zip(&pool) {
            *off = off.min(distance(mean[*at as usize], mean[pool[next] as usize]));
        }
        let farthest = off.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
        next = farthest.map_or(0, |(at, _)| at);
    }
    chosen
}

/// The shares of `chosen` vertices in a joint, and the root of the mean square of the error, metres.
fn regressed(
    bodies: &Bodies,
    kept: &[(usize, f64)],
    mirror: &[u32],
    joint: usize,
    chosen: &[u32],
    most: usize,
) -> (f64, Vec<(u32, f32)>) {
    let n = chosen.len();
    // Vertices from the joint, of every body and its mirror image, `[n, 6 N]`.
    let mut columns: Vec<Vec<f64>> = vec![Vec::with_capacity(6 * kept.len()); n];
    for (body, weight) in kept {
        let (vertices, joints) = (&bodies.vertices[*body], &bodies.joints[*body]);
        let root = (weight / 2.0).sqrt();
        for (column, at) in columns.iter_mut().zip(chosen) {
            let partner = mirror[*at as usize] as usize;
            let own = (vertices[*at as usize], joints[joint], 1.0);
            let mirrored = (vertices[partner], joints[OTHER[joint]], -1.0);
            for (vertex, joint, sign) in [own, mirrored] {
                let off = |c: usize| root * f64::from(vertex[c] - joint[c]);
                column.extend([sign * off(0), off(1), off(2)]);
            }
        }
    }
    let product = |a: usize, b: usize| -> f64 {
        columns[a].iter().zip(&columns[b]).map(|(a, b)| a * b).sum()
    };
    let lower: Vec<Vec<f64>> = (0..n)
        .map(|r| (0..=r).map(|c| product(r, c)).collect())
        .collect();
    let squares = Mat::from_fn(n, n, |r, c| lower[r.max(c)][r.min(c)]);
    let ridge = RIDGE * (0..n).map(|r| squares[(r, r)]).sum::<f64>() / n.max(1) as f64;
    // One more row, 1 for every vertex: shares sum to 1.
    let normal = Mat::from_fn(n, n, |r, c| {
        squares[(r, c)] + 1.0 + if r == c { ridge } else { 0.0 }
    });
    let shares = nnls::solve(&normal, &vec![1.0; n], most);
    let sum: f64 = shares.iter().sum();
    let used: Vec<(usize, f64)> = (shares.iter().enumerate())
        .filter(|(_, share)| **share > 0.0)
        .map(|(at, share)| (at, share / sum))
        .collect();
    let pair = |(a, x): &(usize, f64)| -> f64 {
        used.iter().map(|(b, y)| x * y * squares[(*a, *b)]).sum()
    };
    let error = used.iter().map(pair).sum::<f64>().max(0.0).sqrt();
    (
        error,
        used.iter()
            .map(|(at, share)| (chosen[*at], *share as f32))
            .collect(),
    )
}
