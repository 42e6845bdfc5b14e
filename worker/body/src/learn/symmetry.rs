//! Which vertices are at the same place, and which is the partner of each on the other side.

use super::joints::OTHER as OTHER_JOINT;
use super::read::{Bodies, Topology};
use super::triangles;

/// Farthest that vertices of a seam are apart in the mean, metres.
const SAME_MEAN: f32 = 2e-4;
/// Farthest that they are apart in any body, metres.
const SAME: f32 = 1e-3;
/// Farthest that a partner is from the mirror image of its vertex, metres, where bodies wear what is not symmetric.
const PARTNER: f32 = 0.012;
/// Most candidates for a partner.
const CANDIDATES: usize = 8;
/// The parts on the other side: main, left and right eye.
const OTHER_PART: [u8; 3] = [0, 2, 1];
/// What vertices that other joints move are farther apart, metres: fingers touch.
const SKIN: f32 = 0.05;

/// The first vertex at the same place of each, `[V]`: seams of the texture duplicate vertices.
pub(super) fn weld(bodies: &Bodies, kept: &[(usize, f64)], mean: &[[f32; 3]]) -> Vec<u32> {
    let part = &bodies.topology.part;
    let order = by_height(mean, 0..mean.len() as u32);
    let mut first: Vec<u32> = (0..mean.len() as u32).collect();
    let root = |first: &[u32], mut at: u32| {
        while first[at as usize] != at {
            at = first[at as usize];
        }
        at
    };
    for (i, a) in order.iter().enumerate() {
        let (at, height) = (*a as usize, mean[*a as usize][1]);
        let near = order[i + 1..]
            .iter()
            .take_while(|b| mean[**b as usize][1] - height <= SAME_MEAN);
        for b in near.copied() {
            let other = b as usize;
            let together =
                |points: &[[f32; 3]], most: f32| distance(points[at], points[other]) <= most;
            let same = part[at] == part[other]
                && together(mean, SAME_MEAN)
                && kept
                    .iter()
                    .all(|(body, _)| together(&bodies.vertices[*body], SAME));
            if same {
                let (a, b) = (root(&first, *a), root(&first, b));
                first[a.max(b) as usize] = a.min(b);
            }
        }
    }
    (0..mean.len() as u32).map(|at| root(&first, at)).collect()
}

/// The partner of each vertex on the other side, `[V]`, of bodies with this mean. Partners are mutual wherever the mesh
/// has as many vertices on both sides.
pub(super) fn mirror(topology: &Topology, mean: &[[f32; 3]], welded: &[u32]) -> Vec<u32> {
    let firsts: Vec<u32> = (0..welded.len() as u32)
        .filter(|at| welded[*at as usize] == *at)
        .collect();
    let mut partner: Vec<Option<u32>> = vec![None; mean.len()];
    pair(topology, mean, &firsts, &mut partner);
    triangles::refine(&topology.faces, welded, &mut partner);
    pair(topology, mean, &firsts, &mut partner);
    // Who has found nobody takes the nearest vertex.
    for at in &firsts {
        let place = *at as usize;
        if partner[place].is_none() {
            let off = |other: &&u32| apart(topology, mean, *at, **other);
            let nearest = firsts.iter().min_by(|a, b| off(a).total_cmp(&off(b)));
            partner[place] = nearest.copied();
        }
    }
    let mut members: Vec<Vec<u32>> = vec![Vec::new(); mean.len()];
    for (at, first) in welded.iter().enumerate() {
        members[*first as usize].push(at as u32);
    }
    let of = |at: usize| {
        let first = welded[at];
        let other = partner[first as usize].unwrap_or(first);
        if other == first {
            return at as u32;
        }
        // The duplicates of a seam pair in their order.
        let rank = members[first as usize]
            .iter()
            .position(|member| *member as usize == at);
        let others = &members[other as usize];
        others[rank.unwrap_or(0).min(others.len() - 1)]
    };
    (0..mean.len()).map(of).collect()
}

/// Pairs vertices without a partner, the nearest first.
fn pair(topology: &Topology, mean: &[[f32; 3]], firsts: &[u32], partner: &mut [Option<u32>]) {
    let free = firsts
        .iter()
        .copied()
        .filter(|at| partner[*at as usize].is_none());
    let order = by_height(mean, free);
    let mut pairs: Vec<(f32, u32, u32)> = Vec::new();
    for a in &order {
        let height = mean[*a as usize][1];
        let start = order.partition_point(|b| mean[*b as usize][1] < height - PARTNER);
        let near = order[start..]
            .iter()
            .take_while(|b| mean[**b as usize][1] <= height + PARTNER);
        let mut near: Vec<(f32, u32, u32)> = near
            .map(|b| (apart(topology, mean, *a, *b), *a, *b))
            .filter(|(off, ..)| *off <= PARTNER)
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        pairs.extend(near.into_iter().take(CANDIDATES));
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (_, a, b) in pairs {
        if partner[a as usize].is_none() && partner[b as usize].is_none() {
            partner[a as usize] = Some(b);
            partner[b as usize] = Some(a);
        }
    }
}

/// How far the mirror image of `a` is from `b`, metres, with what [`SKIN`] adds; infinitely far in another part.
fn apart(topology: &Topology, mean: &[[f32; 3]], a: u32, b: u32) -> f32 {
    let (a, b) = (a as usize, b as usize);
    if OTHER_PART[usize::from(topology.part[a])] != topology.part[b] {
        return f32::INFINITY;
    }
    let skin = |at: usize| topology.bones[at].into_iter().zip(topology.weights[at]);
    let common = |(bone, weight): (u8, f32)| {
        let other = OTHER_JOINT[usize::from(bone)];
        let same = skin(b).filter(|(bone, _)| usize::from(*bone) == other);
        weight.min(same.map(|(_, weight)| weight).sum())
    };
    let [x, y, z] = mean[a];
    let different = 1.0 - skin(a).map(common).sum::<f32>();
    distance([-x, y, z], mean[b]) + SKIN * different.max(0.0)
}

/// Rows `[V]` of a body with left and right exchanged: the row of each vertex's partner, with −x if `flip`.
pub(super) fn mirrored(rows: &[[f32; 3]], mirror: &[u32], flip: bool) -> Vec<[f32; 3]> {
    let row = |at: &u32| {
        let [x, y, z] = rows[*at as usize];
        [if flip { -x } else { x }, y, z]
    };
    mirror.iter().map(row).collect()
}

fn by_height(mean: &[[f32; 3]], vertices: impl Iterator<Item = u32>) -> Vec<u32> {
    let mut order: Vec<u32> = vertices.collect();
    order.sort_by(|a, b| mean[*a as usize][1].total_cmp(&mean[*b as usize][1]));
    order
}

pub(super) fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f32>().sqrt()
}
