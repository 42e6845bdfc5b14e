//! Surfaces with fewer triangles, and their normals.

use super::cloud::{cross, minus};
use super::surface::Surface;
use super::unit;
use meshopt::{SimplifyOptions, VertexDataAdapter, simplify};

/// Rounds of smoothing.
const ROUNDS: usize = 10;
/// Factors of the alternating steps towards the neighbours' mean and away from it, which smooth without shrinking
/// (Taubin, "A signal processing approach to fair surface design", 1995).
const STEPS: [f32; 2] = [0.5, -0.53];
/// Largest error of the first attempt at a reduction, metres.
const COARSEST: f32 = 0.01;

/// `surface` without the small steps of the grid.
pub(super) fn smooth(mut surface: Surface) -> Surface {
    let count = surface.positions.len();
    for step in [STEPS; ROUNDS].as_flattened() {
        let mut sums = vec![[0.0f32; 3]; count];
        let mut neighbours = vec![0.0f32; count];
        for [a, b, c] in &surface.triangles {
            // Both directions. An edge between two triangles counts twice, which doesn't change the mean.
            for (from, to) in [(a, b), (b, c), (c, a), (b, a), (c, b), (a, c)] {
                let [from, to] = [*from as usize, *to as usize];
                neighbours[from] += 1.0;
                for (sum, value) in sums[from].iter_mut().zip(surface.positions[to]) {
                    *sum += value;
                }
            }
        }
        for ((position, sum), number) in surface.positions.iter_mut().zip(sums).zip(neighbours) {
            if number > 0.0 {
                *position =
                    std::array::from_fn(|a| position[a] + step * (sum[a] / number - position[a]));
            }
        }
    }
    surface
}

/// `surface` reduced to at most `triangles`, and closed if it was closed.
///
/// The result is within [`COARSEST`] of `surface` if that is possible with `triangles`, and otherwise as near as
/// possible. Holes and handles are preserved, and may need more triangles.
///
/// # Errors
/// If the library refuses the positions.
pub(super) fn reduced(surface: Surface, triangles: usize) -> Result<Surface, meshopt::Error> {
    let bytes: Vec<u8> = surface
        .positions
        .as_flattened()
        .iter()
        .flat_map(|value| value.to_ne_bytes())
        .collect();
    let vertices = VertexDataAdapter::new(&bytes, 12, 0)?;
    let wanted = 3 * triangles;
    let mut indices = surface.triangles.as_flattened().to_vec();
    for error in [COARSEST, f32::MAX] {
        if indices.len() > wanted {
            let options = SimplifyOptions::ErrorAbsolute;
            indices = simplify(&indices, &vertices, wanted, error, options, None);
        }
    }
    // New index of each vertex; `u32::MAX` for vertices that no triangle uses so far.
    let mut indices_of = vec![u32::MAX; surface.positions.len()];
    let mut reduced = Surface::default();
    for corners in indices.as_chunks::<3>().0 {
        let corners = corners.map(|corner| {
            let index = &mut indices_of[corner as usize];
            if *index == u32::MAX {
                *index = reduced.positions.len() as u32;
                reduced.positions.push(surface.positions[corner as usize]);
            }
            *index
        });
        reduced.triangles.push(corners);
    }
    Ok(reduced)
}

/// Unit normals of the vertices: means over their triangles, weighted by area.
pub(super) fn normals(surface: &Surface) -> Vec<[f32; 3]> {
    let mut normals = vec![[0.0f32; 3]; surface.positions.len()];
    for triangle in &surface.triangles {
        let [a, b, c] = triangle.map(|corner| surface.positions[corner as usize]);
        let area = cross(minus(b, a), minus(c, a));
        for corner in triangle {
            let normal = &mut normals[*corner as usize];
            *normal = std::array::from_fn(|i| normal[i] + area[i]);
        }
    }
    // A vertex of triangles without area has no normal, and gets an arbitrary one.
    normals
        .into_iter()
        .map(|normal| {
            if normal == [0.0; 3] {
                [0.0, 1.0, 0.0]
            } else {
                unit(normal)
            }
        })
        .collect()
}
