//! A body in a person's shape and rest pose, fitted to what tells where their surface is.

use super::mesh::normals;
use super::offset::offsets;
use super::rest::RestPose;
use super::shape::{Outline, solve};
use crate::Body;

/// Rounds of each stage: the surface is looked for again where the last round has the body.
const ROUNDS: usize = 4;

/// Stages of a fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// The shape, in the space of bodies.
    Shape,
    /// The offset from that shape.
    Clothes,
}

/// A person's body in their rest pose, metres.
#[derive(Clone, Debug)]
pub struct FittedBody {
    /// Vertices without the offset, `[V, 3]`.
    pub bare: Vec<[f32; 3]>,
    /// Offset of each vertex along the bare body's normal, `[V]`.
    pub heights: Vec<f32>,
    /// Vertices, `[V, 3]`.
    pub vertices: Vec<[f32; 3]>,
    /// Unit normals, outward, `[V, 3]`.
    pub normals: Vec<[f32; 3]>,
}

/// The body of the person with SMPL's `joints` in the rest pose, metres. `seen` gets a body's vertices and normals, `[V, 3]`, and gives the
/// distances along the normals to the person's surface, where that is known. The first round of the shape has bones alone.
pub fn fit(
    body: &Body,
    joints: &[[f32; 3]],
    seen: impl Fn(&[[f32; 3]], &[[f32; 3]], Stage) -> Vec<Outline>,
) -> FittedBody {
    let mut shape = vec![0.0; body.shape_components()];
    for round in 0..=ROUNDS {
        let (rest, vertices) = in_rest_pose(body, &shape, joints);
        let normals = normals(body, &vertices);
        let found = match round {
            0 => Vec::new(),
            _ => seen(&vertices, &normals, Stage::Shape),
        };
        shape = solve(body, &shape, joints, &rest, &normals, &found);
    }
    let (_, bare) = in_rest_pose(body, &shape, joints);
    let directions = normals(body, &bare);
    let mut heights = vec![0f32; bare.len()];
    let mut vertices = bare.clone();
    for _ in 0..ROUNDS {
        let mut found = seen(&vertices, &normals(body, &vertices), Stage::Clothes);
        (found.iter_mut()).for_each(|it| it.distance += heights[it.vertex]);
        heights = offsets(body, &found);
        vertices = (bare.iter().zip(&directions).zip(&heights))
            .map(|((at, normal), height)| std::array::from_fn(|a| at[a] + height * normal[a]))
            .collect();
    }
    FittedBody {
        normals: normals(body, &vertices),
        bare,
        heights,
        vertices,
    }
}

/// The body of the `shape` in the rest pose of joints `to`, without a person's offsets.
fn in_rest_pose(body: &Body, shape: &[f32], to: &[[f32; 3]]) -> (RestPose, Vec<[f32; 3]>) {
    let vertices = body.vertices(shape);
    let rest = RestPose::new(&body.joints_of(&vertices), to);
    let vertices = rest.apply(body, &vertices);
    (rest, vertices)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean body with all that can be known: where another body of its joints is along the normals.
    #[test]
    fn a_body_is_found_from_its_surface() {
        let body = Body::people();
        let mut code = vec![0.0; body.shape_components()];
        (code[0], code[2]) = (1.0, -1.0);
        let truth = body.vertices(&code);
        let joints = body.joints_of(&truth);
        let off = |found: &FittedBody| -> f32 {
            let all = found.vertices.iter().zip(&truth).zip(&found.normals);
            let sum: f32 = all
                .map(|((at, true_at), normal)| {
                    (0..3)
                        .map(|a| (true_at[a] - at[a]) * normal[a])
                        .sum::<f32>()
                        .abs()
                })
                .sum();
            sum / truth.len() as f32
        };
        let known = fit(body, &joints, |vertices, normals, _| {
            (0..vertices.len())
                .step_by(7)
                .map(|vertex| Outline {
                    vertex,
                    distance: (0..3)
                        .map(|a| (truth[vertex][a] - vertices[vertex][a]) * normals[vertex][a])
                        .sum(),
                    frames: 4,
                })
                .collect()
        });
        let unknown = fit(body, &joints, |_, _, _| Vec::new());
        assert!(off(&known) < 0.002, "{}", off(&known));
        assert!(off(&unknown) > 2.0 * off(&known), "{}", off(&unknown));
        assert!(unknown.heights.iter().all(|height| height.abs() < 1e-6));
    }
}
