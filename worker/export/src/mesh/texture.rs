//! The texture of a mesh: the colours of the splats along rays from outside against the surface's normal.

use super::Mesh;
use super::cloud::{Cloud, cross, dot, minus, unit};
use rayon::prelude::*;

/// Largest distance of a splat in front of the surface or behind it, metres.
const DEPTH: f32 = 0.02;
/// Least opacity along a ray; below it, wider splats are tried.
const SEEN: f32 = 0.3;
/// Factors on the splats' widths.
const WIDER: [f32; 3] = [1.0, 2.0, 4.0];
/// Smallest standard deviation along the surface, metres.
const THINNEST: f32 = 1e-4;
/// Width beyond a triangle's edges that it colours if no other triangle does, pixels: sharp corners need it.
const MARGIN: f32 = 1.0;

/// A pixel of the texture that a triangle covers.
struct Texel {
    index: usize,
    point: [f32; 3],
    normal: [f32; 3],
}

/// The texture of `mesh`, `side` x `side` pixels. Pixels without a triangle or without splats nearby have the colour
/// of the nearest pixel with both.
pub(super) fn texture(cloud: &Cloud, mesh: &Mesh) -> Vec<[u8; 3]> {
    let side = mesh.side as usize;
    let texels = texels(mesh);
    let colours: Vec<Option<[u8; 3]>> = texels
        .par_iter()
        .map(|texel| {
            let colour = WIDER.iter().find_map(|wider| seen(cloud, texel, *wider))?;
            Some(colour.map(|value| (255.0 * value.clamp(0.0, 1.0)).round() as u8))
        })
        .collect();
    let mut pixels: Vec<Option<[u8; 3]>> = vec![None; side * side];
    for (texel, colour) in texels.iter().zip(colours) {
        pixels[texel.index] = colour;
    }
    spread(&mut pixels, side);
    // A texture without any triangle stays black.
    pixels.into_iter().map(Option::unwrap_or_default).collect()
}

/// The pixels that triangles cover, each once: first the pixels inside triangles, then those at their edges.
fn texels(mesh: &Mesh) -> Vec<Texel> {
    let side = mesh.side as usize;
    let mut taken = vec![false; side * side];
    let mut texels = Vec::new();
    for margin in [0.0, MARGIN] {
        for triangle in &mesh.triangles {
            cover(mesh, *triangle, margin, &mut taken, &mut texels);
        }
    }
    texels
}

/// Adds the pixels that are at most `margin` pixels beyond a triangle and not yet `taken`.
fn cover(
    mesh: &Mesh,
    triangle: [u32; 3],
    margin: f32,
    taken: &mut [bool],
    texels: &mut Vec<Texel>,
) {
    let side = mesh.side as usize;
    let corners = triangle.map(|corner| corner as usize);
    let at = corners.map(|corner| mesh.coordinates[corner].map(|value| value * side as f32));
    let area = edge(at[0], at[1], at[2]);
    if area == 0.0 {
        return;
    }
    let range = |a: usize| {
        let ends = at.map(|corner| corner[a]);
        let low = ends.into_iter().fold(f32::INFINITY, f32::min) - margin;
        let high = ends.into_iter().fold(0.0, f32::max) + margin;
        (low.max(0.0) as usize)..((high.ceil() as usize).min(side))
    };
    for row in range(1) {
        for column in range(0) {
            let index = row * side + column;
            let pixel = [column as f32 + 0.5, row as f32 + 0.5];
            let parts = [
                edge(at[1], at[2], pixel) / area,
                edge(at[2], at[0], pixel) / area,
                edge(at[0], at[1], pixel) / area,
            ];
            // A point of the triangle near the pixel: the pixel itself if it is inside.
            let inside = parts.map(|part| part.max(0.0));
            let sum: f32 = inside.iter().sum();
            let parts = inside.map(|part| part / sum);
            let off: f32 = (0..2)
                .map(|a| {
                    let nearest: f32 = (0..3).map(|c| parts[c] * at[c][a]).sum();
                    (nearest - pixel[a]).powi(2)
                })
                .sum();
            // False for NaN too, which a triangle of almost no area gives.
            let near = off <= margin * margin + 1e-6;
            if taken[index] || !near {
                continue;
            }
            taken[index] = true;
            let mean = |rows: &[[f32; 3]]| -> [f32; 3] {
                std::array::from_fn(|a| (0..3).map(|c| parts[c] * rows[corners[c]][a]).sum())
            };
            texels.push(Texel {
                index,
                point: mean(&mesh.positions),
                normal: unit(mean(&mesh.normals)),
            });
        }
    }
}

/// Twice the signed area of a triangle.
fn edge(a: [f32; 2], b: [f32; 2], c: [f32; 2]) -> f32 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// The colour along a ray against the normal, composited front to back; `None` if the ray meets almost nothing.
fn seen(cloud: &Cloud, texel: &Texel, wider: f32) -> Option<[f32; 3]> {
    let normal = texel.normal;
    // Two directions along the surface.
    let helper = if normal[1].abs() < 0.9 {
        [0.0, 1.0, 0.0]
    } else {
        [1.0, 0.0, 0.0]
    };
    let across = unit(cross(normal, helper));
    let along = cross(normal, across);
    let mut hits: Vec<(f32, f32, [f32; 3])> = Vec::new();
    cloud.near(texel.point, |disc| {
        let from = minus(disc.mean, texel.point);
        let height = dot(from, normal);
        if height.abs() > DEPTH || dot(disc.normal(), normal) < 0.0 {
            return;
        }
        // The splat's projection on the surface: its covariance [xx, xy, yy].
        let (mut xx, mut xy, mut yy) = (THINNEST * THINNEST, 0.0, THINNEST * THINNEST);
        for (axis, deviation) in disc.axes.iter().zip(disc.deviations) {
            let x = wider * deviation * dot(*axis, across);
            let y = wider * deviation * dot(*axis, along);
            xx += x * x;
            xy += x * y;
            yy += y * y;
        }
        let (x, y) = (dot(from, across), dot(from, along));
        let square = (yy * x * x - 2.0 * xy * x * y + xx * y * y) / (xx * yy - xy * xy);
        let alpha = (disc.opacity * (-0.5 * square).exp()).min(0.99);
        if alpha > 1.0 / 255.0 {
            hits.push((height, alpha, disc.colour));
        }
    });
    hits.sort_by(|(one, ..), (other, ..)| other.total_cmp(one));
    let (mut colour, mut left) = ([0.0; 3], 1.0);
    for (_, alpha, shown) in hits {
        colour = std::array::from_fn(|c| colour[c] + left * alpha * shown[c]);
        left *= 1.0 - alpha;
    }
    let met = 1.0 - left;
    (met > SEEN).then(|| colour.map(|value| value / met))
}

/// Gives pixels without a colour that of the nearest one with a colour, so that filtering at the edges of charts does
/// not blend with the background.
fn spread(pixels: &mut [Option<[u8; 3]>], side: usize) {
    let mut edge: Vec<usize> = (0..pixels.len())
        .filter(|at| pixels[*at].is_some())
        .collect();
    while !edge.is_empty() {
        let mut next = Vec::new();
        for at in edge {
            let (row, column) = (at / side, at % side);
            let beside = [
                (column > 0).then(|| at - 1),
                (column + 1 < side).then_some(at + 1),
                (row > 0).then(|| at - side),
                (row + 1 < side).then_some(at + side),
            ];
            for beside in beside.into_iter().flatten() {
                if pixels[beside].is_none() {
                    pixels[beside] = pixels[at];
                    next.push(beside);
                }
            }
        }
        edge = next;
    }
}
