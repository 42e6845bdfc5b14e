//! The faces of the body that can be seen from outside. The mesh also has surface inside of clothes, hair and mouth.

use super::rest::{cross, dot, unit};
use crate::Body;
use rayon::prelude::*;
use std::f32::consts::PI;
use std::sync::OnceLock;

/// Directions that the body is looked at from.
const VIEWS: usize = 64;
/// Width of a pixel, metres.
const PIXEL: f32 = 0.003;
/// How far behind the first surface a vertex still counts as seen, metres.
const BEHIND: f32 = 0.006;

/// Whether each face `[F]` of the program's body can be seen: the mean body from some side.
pub fn visible_faces(body: &Body) -> &'static [bool] {
    static VISIBLE: OnceLock<Vec<bool>> = OnceLock::new();
    VISIBLE.get_or_init(|| {
        let seen = seen_vertices(&body.mean, &body.faces);
        let any = |face: &[u32; 3]| face.iter().any(|vertex| seen[*vertex as usize]);
        body.faces.iter().map(any).collect()
    })
}

/// Whether each of the `vertices` `[V]` is on the first surface from some side.
fn seen_vertices(vertices: &[[f32; 3]], faces: &[[u32; 3]]) -> Vec<bool> {
    let views: Vec<Vec<bool>> = (0..VIEWS)
        .into_par_iter()
        .map(|view| seen_from(direction(view), vertices, faces))
        .collect();
    (0..vertices.len())
        .map(|i| views.iter().any(|seen| seen[i]))
        .collect()
}

/// Directions that are spread evenly over the sphere (the spherical Fibonacci lattice).
fn direction(view: usize) -> [f32; 3] {
    let golden = PI * (3.0 - 5f32.sqrt());
    let y = 1.0 - (2.0 * view as f32 + 1.0) / VIEWS as f32;
    let across = (1.0 - y * y).sqrt();
    let angle = golden * view as f32;
    [across * angle.cos(), y, across * angle.sin()]
}

/// Whether each vertex is on the first surface, looked at against the direction `from`, without perspective.
fn seen_from(from: [f32; 3], vertices: &[[f32; 3]], faces: &[[u32; 3]]) -> Vec<bool> {
    let helper = if from[1].abs() < 0.9 {
        [0.0, 1.0, 0.0]
    } else {
        [1.0, 0.0, 0.0]
    };
    let right = unit(cross(helper, from));
    let up = cross(from, right);
    let placed: Vec<[f32; 3]> = vertices
        .iter()
        .map(|at| {
            [
                dot(*at, right) / PIXEL,
                dot(*at, up) / PIXEL,
                dot(*at, from),
            ]
        })
        .collect();
    let bound = |axis: usize, least: bool| {
        let values = placed.iter().map(|at| at[axis]);
        match least {
            true => values.fold(f32::INFINITY, f32::min),
            false => values.fold(f32::NEG_INFINITY, f32::max),
        }
    };
    let low = [bound(0, true), bound(1, true)];
    let width = (bound(0, false) - low[0]) as usize + 2;
    let height = (bound(1, false) - low[1]) as usize + 2;
    let mut nearest = vec![f32::NEG_INFINITY; width * height];
    for face in faces {
        let corners = face.map(|vertex| {
            let [x, y, depth] = placed[vertex as usize];
            [x - low[0], y - low[1], depth]
        });
        rasterize(corners, width, &mut nearest);
    }
    placed
        .iter()
        .map(|[x, y, depth]| {
            let pixel = (y - low[1]) as usize * width + (x - low[0]) as usize;
            *depth >= nearest[pixel] - BEHIND
        })
        .collect()
}

/// Keeps the depth nearest to the viewer at the pixels whose middle is in a triangle.
fn rasterize(corners: [[f32; 3]; 3], width: usize, nearest: &mut [f32]) {
    let [a, b, c] = corners;
    let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    if area.abs() < 1e-9 {
        return;
    }
    let range = |axis: usize| {
        let least = a[axis].min(b[axis]).min(c[axis]);
        let most = a[axis].max(b[axis]).max(c[axis]);
        (least - 0.5).max(0.0) as usize..=(most + 0.5) as usize
    };
    for row in range(1) {
        for column in range(0) {
            let (x, y) = (column as f32 + 0.5, row as f32 + 0.5);
            let share = |p: [f32; 3], q: [f32; 3]| {
                ((p[0] - x) * (q[1] - y) - (p[1] - y) * (q[0] - x)) / area
            };
            let shares = [share(b, c), share(c, a), share(a, b)];
            if shares.iter().all(|share| *share >= 0.0) {
                let depth = shares[0] * a[2] + shares[1] * b[2] + shares[2] * c[2];
                if let Some(pixel) = nearest.get_mut(row * width + column) {
                    *pixel = pixel.max(depth);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_inside_of_a_box_is_hidden() {
        // A box of side 0.2 m, and a small triangle in its middle.
        let corner = |i: usize| [i & 1, i >> 1 & 1, i >> 2].map(|bit| 0.2 * bit as f32 - 0.1);
        let mut vertices: Vec<[f32; 3]> = (0..8).map(corner).collect();
        let sides: [[u32; 4]; 6] = [
            [0, 1, 3, 2],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 3, 7, 6],
            [0, 2, 6, 4],
            [1, 3, 7, 5],
        ];
        let mut faces: Vec<[u32; 3]> = (sides.iter())
            .flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]])
            .collect();
        vertices.extend([[0.0, 0.0, 0.0], [0.02, 0.0, 0.0], [0.0, 0.02, 0.0]]);
        faces.push([8, 9, 10]);
        let seen = seen_vertices(&vertices, &faces);
        assert!(seen[..8].iter().all(|seen| *seen));
        assert!(!seen[8] && !seen[9] && !seen[10]);
    }

    #[test]
    fn most_of_the_body_can_be_seen() {
        let body = Body::people();
        let visible = visible_faces(body);
        let share = visible.iter().filter(|seen| **seen).count() as f32 / visible.len() as f32;
        assert!((0.5..1.0).contains(&share), "{share}");
    }
}
