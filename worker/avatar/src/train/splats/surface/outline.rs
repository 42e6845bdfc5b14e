//! Outlines of a posed body in the masks of frames: how far each vertex is from the edge of the mask, along its normal. No frame's
//! edge is nearer than the surface, and in a frame that sees the vertex edge-on the surface is at the edge, unless another part of the
//! body is beside it. So the least distances count.

use crate::train::splats::hull::HullFrame;
use rayon::prelude::*;
use yoto_body::Body;
use yoto_body::person::shape::Outline;
use yoto_ops::warp::inverse::solve::{apply, rigid_inverse};

/// Largest cosine between a vertex's normal and the line of sight at an outline.
const EDGE_ON: f32 = 0.25;
/// Largest cosine at which an edge bounds the surface: beyond it, a step along the normal hardly moves in the picture.
const ASIDE: f32 = 0.7;
/// Share of the frames whose edges are nearer than the surface, by errors of masks and poses that the hull does not count.
const NEARER: f32 = 0.1;
/// Distance up to which frames agree, metres, the fewest that must, and their share of those that see a vertex edge-on.
const AGREE: f32 = 0.012;
const FEWEST: usize = 3;
const MOSTLY: f32 = 0.35;
/// Step along the normal, metres.
const STEP: f32 = 0.004;
/// Coverage that the edge of a mask has.
const EDGE: f32 = 127.5;

/// Distances along the normals that are looked at, metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search {
    pub inward: f32,
    pub outward: f32,
}

/// A body in the rest pose.
pub(super) struct RestSurface<'a> {
    pub body: &'a Body,
    /// `[V, 3]`, metres.
    pub vertices: &'a [[f32; 3]],
    /// `[V, 3]`, unit vectors, outward.
    pub normals: &'a [[f32; 3]],
}

/// The distance of each vertex to the edge of the masks, where at least one of the `frames` sees it edge-on. In `forgiven` frames the edge
/// may be nearer.
pub(super) fn outlines(
    surface: &RestSurface<'_>,
    frames: &[HullFrame],
    forgiven: usize,
    search: Search,
) -> Vec<Outline> {
    let mut distances: Vec<Vec<(f32, bool)>> = vec![Vec::new(); surface.vertices.len()];
    for frame in frames {
        let forward = forward(frame);
        distances.par_iter_mut().enumerate().for_each(|(i, own)| {
            own.extend(surface.edge(i, frame, &forward, search));
        });
    }
    let found = distances.into_iter().enumerate();
    found
        .filter_map(|(vertex, own)| {
            let (distance, agreed) =
                agreed(own, forgiven).filter(|(distance, _)| *distance < search.outward)?;
            Some(Outline {
                vertex,
                distance,
                frames: agreed,
            })
        })
        .collect()
}

/// The distance to the edge by what frames say, each with whether it sees the point edge-on, and the number of these that agree on it;
/// `None` if hardly any do, as where two parts touch in every frame.
fn agreed(mut distances: Vec<(f32, bool)>, forgiven: usize) -> Option<(f32, u32)> {
    distances.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let rank = forgiven + (NEARER * distances.len() as f32) as usize;
    let (distance, _) = *distances.get(rank.min(distances.len().checked_sub(1)?))?;
    let edge_on = distances.iter().filter(|(_, edge_on)| *edge_on);
    let all = edge_on.clone().count();
    let agreed = edge_on
        .filter(|(other, _)| (other - distance).abs() < AGREE)
        .count();
    let enough = agreed >= FEWEST.min(all.max(1)) && agreed as f32 >= MOSTLY * all as f32;
    enough.then_some((distance, agreed as u32))
}

impl RestSurface<'_> {
    /// As [`edge`], of vertex `i`.
    fn edge(
        &self,
        i: usize,
        frame: &HullFrame,
        forward: &[[f32; 12]],
        search: Search,
    ) -> Option<(f32, bool)> {
        let bones = self.body.bones[i].iter().zip(self.body.weights[i]);
        let bones = bones.map(|(bone, weight)| (*bone, weight));
        let transform = blend(forward, bones);
        edge(frame, &transform, self.vertices[i], self.normals[i], search)
    }
}

/// Canonical to posed of each bone in a frame.
pub(super) fn forward(frame: &HullFrame) -> Vec<[f32; 12]> {
    let bones = frame.transforms().as_chunks::<12>().0.iter();
    bones.map(rigid_inverse).collect()
}

/// Σ wᵢ Gᵢ.
pub(super) fn blend(forward: &[[f32; 12]], bones: impl Iterator<Item = (u8, f32)>) -> [f32; 12] {
    let mut sum = [0f32; 12];
    for (bone, weight) in bones {
        for (to, from) in sum.iter_mut().zip(&forward[usize::from(bone)]) {
            *to += weight * from;
        }
    }
    sum
}

/// The distance of a canonical `point` along its `normal` to the edge of the mask, and whether the frame sees it edge-on; `None` if it
/// sees it from the front or from behind, or outside of the picture. `transform` takes it to the posed body.
pub(super) fn edge(
    frame: &HullFrame,
    transform: &[f32; 12],
    point: [f32; 3],
    normal: [f32; 3],
    search: Search,
) -> Option<(f32, bool)> {
    let at = apply(transform, point);
    let normal: [f32; 3] =
        std::array::from_fn(|r| (0..3).map(|c| transform[4 * r + c] * normal[c]).sum());
    let sight: [f32; 3] = std::array::from_fn(|r| {
        let [a, b, c, d] = frame.camera[r];
        a * at[0] + b * at[1] + c * at[2] + d
    });
    let facing: [f32; 3] =
        std::array::from_fn(|r| (0..3).map(|c| frame.camera[r][c] * normal[c]).sum());
    let dot: f32 = (0..3).map(|a| sight[a] * facing[a]).sum();
    let length = |v: [f32; 3]| v.iter().map(|v| v * v).sum::<f32>().sqrt();
    let cosine = dot.abs() / (length(sight) * length(facing)).max(1e-6);
    if cosine > ASIDE {
        return None;
    }
    let edge_on = cosine < EDGE_ON;
    let coverage = |along: f32| {
        let point = std::array::from_fn(|a| at[a] + along * normal[a]);
        frame.coverage(point)
    };
    let mut here = coverage(0.0)?;
    let inside = here >= EDGE;
    let (step, limit) = match inside {
        true => (STEP, search.outward),
        false => (-STEP, search.inward),
    };
    let mut along = 0.0f32;
    while along.abs() < limit {
        let next = coverage(along + step)?;
        if (next >= EDGE) != inside {
            let share = (here - EDGE) / (here - next);
            return Some((along + share * step, edge_on));
        }
        (here, along) = (next, along + step);
    }
    // Far inside: another part of the body covers the point. Far outside, the pose is wrong.
    inside.then_some((search.outward, edge_on))
}
