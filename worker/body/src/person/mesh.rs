//! Normals, areas and neighbours of a body's surface. Seams of the texture duplicate vertices: all of them count as their first.

use super::rest::{cross, length, sub, unit};
use crate::Body;

/// Unit normals `[V, 3]` of the `vertices` `[V, 3]`, outward; equal at seams.
pub fn normals(body: &Body, vertices: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let mut sums = vec![[0f32; 3]; vertices.len()];
    for face in &body.faces {
        let normal = face_normal(vertices, *face);
        for vertex in face {
            let sum = &mut sums[body.welded[*vertex as usize] as usize];
            for (sum, part) in sum.iter_mut().zip(normal) {
                *sum += part;
            }
        }
    }
    let welded = body.welded.iter();
    welded.map(|first| unit(sums[*first as usize])).collect()
}

/// The normal of a triangle, twice as long as its area.
fn face_normal(vertices: &[[f32; 3]], face: [u32; 3]) -> [f32; 3] {
    let [a, b, c] = face.map(|vertex| vertices[vertex as usize]);
    cross(sub(b, a), sub(c, a))
}

/// Areas `[F]` of the faces, square metres.
pub fn areas(body: &Body, vertices: &[[f32; 3]]) -> Vec<f32> {
    let faces = body.faces.iter();
    faces
        .map(|face| 0.5 * length(face_normal(vertices, *face)))
        .collect()
}

/// The neighbours of each vertex along edges, by the first vertex at each place. Other vertices at a place have none.
pub fn neighbours(body: &Body) -> Vec<Vec<u32>> {
    let mut neighbours = vec![Vec::new(); body.mean.len()];
    for face in &body.faces {
        let [a, b, c] = face.map(|vertex| body.welded[vertex as usize]);
        for (from, to) in [(a, b), (b, c), (c, a)] {
            if from != to {
                neighbours[from as usize].push(to);
                neighbours[to as usize].push(from);
            }
        }
    }
    for own in &mut neighbours {
        own.sort_unstable();
        own.dedup();
    }
    neighbours
}
