//! Hands of the shared body in place of those of a surface through splats, which joins fingers.

use super::cloud::{Cloud, dot, minus};
use super::surface::{OUTWARD, Surface};
use rayon::prelude::*;
use yoto_body::person::fit::{FittedBody, fit};
use yoto_body::person::shape::Outline;
use yoto_body::{Body, hand_of};
use yoto_capture::skeleton::Skeleton;

/// Standard deviation of a plane's weight, metres.
const SPREAD: f32 = 0.012;
/// Least sum of weights of planes that tell where the surface is.
const BELIEVED: f32 = 0.5;
/// Least cosine between a plane's normal and the body's: others are the far side of a limb, or another part.
const ALIKE: f32 = 0.3;
/// Steps along the normal towards the planes, and the change at which they end, metres.
const STEPS: usize = 8;
const CLOSE: f32 = 5e-4;
/// Farthest plane from the body, metres.
const FARTHEST: f32 = 0.08;
/// Frames that a vertex counts as in the body's fit.
const FRAMES: u32 = 1;
/// Rings of faces of the forearm that belong to a hand, so that it reaches into the sleeve.
const CUFF: usize = 3;
/// Distance of a splat that shows a vertex of a hand, metres, and the share of the vertices that splats must show.
const NEAR: f32 = 0.02;
const SHOWN: f64 = 0.3;

/// The surface `through` the splats of `cloud` with the body's hands, where splats show hands.
pub(super) fn with_hands(cloud: &Cloud, skeleton: &Skeleton, through: Surface) -> Surface {
    let body = Body::for_joints(skeleton.joints());
    let joints: Vec<[f32; 3]> = (skeleton.rest.iter())
        .map(|at| at.map(|v| v as f32))
        .collect();
    // Fingers are nearer to each other than splats are: the planes of one would be taken for those of another.
    let fitted = fit(body, &joints, |vertices, normals, _| {
        (vertices.par_iter().zip(normals).enumerate())
            .filter(|(vertex, _)| hand_of(body.bones[*vertex][0]).is_none())
            .filter_map(|(vertex, (at, normal))| {
                let distance = to_planes(cloud, *at, *normal)?;
                Some(Outline {
                    vertex,
                    distance,
                    frames: FRAMES,
                })
            })
            .collect()
    });
    let hands: Vec<usize> = (0..2)
        .filter(|side| is_shown(cloud, body, &fitted, *side))
        .collect();
    replaced(body, &fitted, through, &hands)
}

/// The distance from a point along a normal to the planes around it, metres; `None` if too few splats tell.
fn to_planes(cloud: &Cloud, from: [f32; 3], normal: [f32; 3]) -> Option<f32> {
    let mut along = 0.0f32;
    for _ in 0..STEPS {
        let at: [f32; 3] = std::array::from_fn(|a| from[a] + along * normal[a]);
        let (mut weights, mut sum) = (0.0f32, 0.0f32);
        cloud.near(at, |disc| {
            let cosine = dot(disc.normal(), normal);
            if cosine < ALIKE {
                return;
            }
            let offset = minus(at, disc.mean);
            let height = dot(offset, disc.normal()) - OUTWARD * disc.deviations[2];
            let square = dot(offset, offset) / (SPREAD * SPREAD);
            let weight = disc.opacity * cosine * (-0.5 * square).exp();
            weights += weight;
            sum += weight * height / cosine;
        });
        if weights < BELIEVED {
            return None;
        }
        let step = -sum / weights;
        along += step.clamp(-SPREAD, SPREAD);
        if along.abs() > FARTHEST {
            return None;
        }
        if step.abs() < CLOSE {
            return Some(along);
        }
    }
    None
}

/// Whether splats show the hand of this side: a person may lack it, or a film may not show it.
fn is_shown(cloud: &Cloud, body: &Body, fitted: &FittedBody, side: usize) -> bool {
    let own: Vec<&[f32; 3]> = (fitted.vertices.iter().zip(&body.bones))
        .filter(|(_, own)| hand_of(own[0]) == Some(side))
        .map(|(at, _)| at)
        .collect();
    let has_splat = |at: &&&[f32; 3]| {
        let mut near = false;
        cloud.near(***at, |disc| {
            let offset = minus(***at, disc.mean);
            near |= dot(offset, offset) < NEAR * NEAR;
        });
        near
    };
    let shown = own.iter().filter(has_splat).count();
    shown as f64 >= SHOWN * own.len() as f64
}

/// `through` with the body's hands of these `sides` in place of its own.
fn replaced(body: &Body, fitted: &FittedBody, through: Surface, sides: &[usize]) -> Surface {
    if sides.is_empty() {
        return through;
    }
    let of_hand: Vec<bool> = (body.bones.iter())
        .map(|own| hand_of(own[0]).is_some_and(|side| sides.contains(&side)))
        .collect();
    let on_hand: Vec<bool> = (through.positions.par_iter())
        .map(|at| of_hand[nearest(&fitted.vertices, *at)])
        .collect();
    let mut surface = through;
    (surface.triangles).retain(|corners| !corners.iter().all(|it| on_hand[*it as usize]));
    let first = surface.positions.len() as u32;
    surface.positions.extend_from_slice(&fitted.vertices);
    // One vertex per place: the mesh gets texture coordinates, and seams, of its own.
    let welded = |face: [u32; 3]| face.map(|it| first + body.welded[it as usize]);
    (surface.triangles).extend(faces(body, of_hand).into_iter().map(welded));
    surface
}

/// The faces of hands and of the ends of forearms.
fn faces(body: &Body, mut near: Vec<bool>) -> Vec<[u32; 3]> {
    for _ in 0..CUFF {
        let touched: Vec<u32> = (body.faces.iter())
            .filter(|face| face.iter().any(|it| near[*it as usize]))
            .flatten()
            .copied()
            .collect();
        touched.into_iter().for_each(|it| near[it as usize] = true);
    }
    let faces = body.faces.iter().copied();
    let inside = |face: &[u32; 3]| face.iter().all(|it| near[*it as usize]);
    faces.filter(inside).collect()
}

/// The index of the vertex nearest to `at`.
fn nearest(vertices: &[[f32; 3]], at: [f32; 3]) -> usize {
    let square = |vertex: &[f32; 3]| {
        let offset = minus(at, *vertex);
        dot(offset, offset)
    };
    let all = vertices.iter().map(square).enumerate();
    all.min_by(|a, b| a.1.total_cmp(&b.1))
        .map_or(0, |(index, _)| index)
}
