//! What stands off a person's body: skirts, coats, hair, bags. It is the part of the hull's shell that is clearly outside of the
//! body's surface. Its weights are those of the nearest vertices, spread over the layer itself, so that a skirt does not split between
//! the thighs.

use super::outline::{Search, blend, edge, forward};
use super::points::SurfacePoints;
use super::silhouette::outside;
use crate::train::splats::hull::{HullFrame, Shell};
use rayon::prelude::*;
use tracing::debug;
use yoto_body::person::sample::strongest;
use yoto_body::{WITH_FACE, WITH_FINGERS};

/// Distance to the body's surface from which a point is beside it, metres.
const STANDS_OFF: f32 = 0.02;
/// Distance up to which a point is at the edge of a mask, and how far the edge is looked for, metres.
const AT_EDGE: f32 = 0.025;
const LOOKED_FOR: Search = Search {
    inward: 0.05,
    outward: 0.05,
};
/// Frames that must show a point at the edge, at least and as a share of those that see it edge-on. Others are in the hull because parts
/// touch, as a hand and a pocket.
const FEWEST: usize = 3;
const MOSTLY: f64 = 0.15;
/// Joints of the arms, which touch the body in every frame of many films.
const ARMS: std::ops::Range<u8> = 16..WITH_FINGERS as u8;
/// Distance that weights spread over a layer, metres.
const SPREAD: f64 = 0.15;
/// Neighbours that a point takes weights from.
const NEIGHBOURS: usize = 8;
/// Most rounds of spreading.
const MOST_ROUNDS: f64 = 400.0;
/// Distance of neighbours, in spacings of the shell.
const NEAR: f64 = 2.5;

/// The points of the `shell` that no point of the body's surface is near, with the bones that carry them. `own` are points of that
/// surface, `apart` metres from each other, of which those that are not `kept` are beside the masks. The spacing is the shell's.
pub(in crate::train::splats) fn beside(
    own: &SurfacePoints,
    kept: &[bool],
    apart: f64,
    shell: &Shell,
    frames: &[HullFrame],
) -> SurfacePoints {
    let nearest: Vec<Nearest> = (shell.points.par_iter())
        .map(|point| Nearest::of(*point, own, kept))
        .collect();
    let off: Vec<usize> = (0..shell.points.len())
        .filter(|i| nearest[*i].kept > STANDS_OFF)
        .collect();
    let points: Vec<[f32; 3]> = off.iter().map(|i| shell.points[*i]).collect();
    let normals: Vec<[f32; 3]> = off.iter().map(|i| shell.normals[*i]).collect();
    let weights = off
        .iter()
        .map(|i| dense(&own.skinning[nearest[*i].index]))
        .collect();
    let skinning: Vec<[(u8, f32); 4]> = spread(&points, weights, shell.spacing)
        .into_iter()
        .map(|row| strongest((0..).zip(row)))
        .collect();
    let at_edges = at_edges(&points, &normals, &skinning, frames);
    // Where no frame tells how deep the person is, hulls reach far before them.
    let outside = match shell.depth_unseen {
        true => outside(&points, &skinning, (own, kept), apart, frames),
        false => vec![true; points.len()],
    };
    let chosen: Vec<usize> = (0..points.len())
        .filter(|i| {
            let body_is_wrong = !kept[nearest[off[*i]].index];
            let stands_off = at_edges[*i] && outside[*i];
            body_is_wrong || (stands_off && !ARMS.contains(&skinning[*i][0].0))
        })
        .collect();
    debug!(off = off.len(), chosen = chosen.len(), "layer");
    SurfacePoints {
        points: chosen.iter().map(|i| points[*i]).collect(),
        normals: chosen.iter().map(|i| normals[*i]).collect(),
        skinning: chosen.iter().map(|i| skinning[*i]).collect(),
        ..SurfacePoints::default()
    }
}

/// The points of the body's surface nearest to another point.
struct Nearest {
    /// Index of the nearest of all.
    index: usize,
    /// Distance to the nearest that is kept, metres.
    kept: f32,
}

impl Nearest {
    fn of(point: [f32; 3], own: &SurfacePoints, kept: &[bool]) -> Self {
        let (mut index, mut any, mut least) = (0, f32::INFINITY, f32::INFINITY);
        for (i, at) in own.points.iter().enumerate() {
            let square: f32 = (0..3).map(|a| (point[a] - at[a]).powi(2)).sum();
            if square < any {
                (any, index) = (square, i);
            }
            if kept[i] && square < least {
                least = square;
            }
        }
        Self {
            index,
            kept: least.sqrt(),
        }
    }
}

/// Whether each point is at the edge of the masks, where `frames` see it edge-on.
fn at_edges(
    points: &[[f32; 3]],
    normals: &[[f32; 3]],
    skinning: &[[(u8, f32); 4]],
    frames: &[HullFrame],
) -> Vec<bool> {
    let mut counts = vec![[0usize; 2]; points.len()];
    for frame in frames {
        let forward = forward(frame);
        counts.par_iter_mut().enumerate().for_each(|(i, count)| {
            let transform = blend(&forward, skinning[i].into_iter());
            if let Some((distance, true)) =
                edge(frame, &transform, points[i], normals[i], LOOKED_FOR)
            {
                count[0] += 1;
                count[1] += usize::from(distance.abs() < AT_EDGE);
            }
        });
    }
    let at_edges = |[edge_on, at_edge]: [usize; 2]| {
        at_edge >= FEWEST && at_edge as f64 >= MOSTLY * edge_on as f64
    };
    counts.into_iter().map(at_edges).collect()
}

/// The weights of a point, one per bone.
fn dense(skinning: &[(u8, f32); 4]) -> Vec<f32> {
    let mut row = vec![0.0; WITH_FACE];
    for (bone, weight) in skinning {
        row[usize::from(*bone)] += weight;
    }
    row
}

/// `weights` `[N][K]` of points after a diffusion over the graph of near points, by [`SPREAD`].
fn spread(points: &[[f32; 3]], mut weights: Vec<Vec<f32>>, spacing: f64) -> Vec<Vec<f32>> {
    let reach = ((NEAR * spacing) as f32).powi(2);
    let neighbours: Vec<Vec<usize>> = points
        .par_iter()
        .map(|at| {
            let mut near: Vec<(f32, usize)> = (points.iter().enumerate())
                .map(|(i, other)| ((0..3).map(|a| (at[a] - other[a]).powi(2)).sum::<f32>(), i))
                .filter(|(square, _)| *square > 0.0 && *square < reach)
                .collect();
            near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
            near.truncate(NEIGHBOURS);
            near.into_iter().map(|(_, i)| i).collect()
        })
        .collect();
    // A round spreads by about one spacing, and n rounds by √n.
    let rounds = (SPREAD / spacing).powi(2).min(MOST_ROUNDS) as usize;
    for _ in 0..rounds {
        weights = neighbours
            .par_iter()
            .enumerate()
            .map(|(i, near)| {
                let mut row = weights[i].clone();
                for other in near {
                    row.iter_mut()
                        .zip(&weights[*other])
                        .for_each(|(sum, weight)| *sum += weight);
                }
                let count = (near.len() + 1) as f32;
                row.iter_mut().for_each(|sum| *sum /= count);
                row
            })
            .collect();
    }
    weights
}
