//! The start of a person's splats on a body's surface: the shared body in the person's shape, by their bones and outlines, and
//! what outlines tell beyond the space of shapes.

mod between_legs;
pub(super) mod layer;
mod outline;
pub(super) mod points;
mod skirt;

use crate::train::splats::hull::HullFrames;
use outline::{RestSurface, Search, outlines};
use points::SurfacePoints;
pub(super) use skirt::Skirt;
use tracing::{debug, trace_span};
use yoto_body::Body;
use yoto_body::person::mesh::{areas, normals};
use yoto_body::person::offset::offsets;
use yoto_body::person::rest::RestPose;
use yoto_body::person::sample::spread;
use yoto_body::person::shape::{Outline, solve};
use yoto_body::person::visible::visible_faces;
use yoto_capture::skeleton::Skeleton;

/// Rounds of the fit of the shape: outlines are looked for again where the last shape has them.
const ROUNDS: usize = 4;
/// How far from the body an outline is looked for while its shape is found, and after it, metres.
const SHAPE: Search = Search {
    inward: 0.08,
    outward: 0.08,
};
const CLOTHES: Search = Search {
    inward: 0.10,
    outward: 0.12,
};

/// A person's surface in the rest pose.
pub(super) struct PersonSurface {
    /// `[V, 3]`, metres.
    pub vertices: Vec<[f32; 3]>,
    /// `[V, 3]`, unit vectors, outward.
    pub normals: Vec<[f32; 3]>,
    /// What hangs over both legs, if the film shows that.
    pub skirt: Option<Skirt>,
}

impl PersonSurface {
    /// The surface of the person whom the frames of `hull` show.
    pub(super) fn new(body: &Body, skeleton: &Skeleton, hull: &HullFrames<'_>) -> Self {
        let _span = trace_span!("surface").entered();
        let joints: Vec<[f32; 3]> = (skeleton.rest.iter())
            .map(|at| at.map(|v| v as f32))
            .collect();
        let shape = fitted_shape(body, &joints, hull);
        let (_, bare) = in_rest_pose(body, &shape, &joints);
        let (vertices, heights) = with_clothes(body, &bare, hull);
        Self {
            skirt: Skirt::find(body, &joints, &bare, &heights, hull),
            normals: normals(body, &vertices),
            vertices,
        }
    }
}

/// The shape of the person with these `joints` in the rest pose. The first round has bones alone.
fn fitted_shape(body: &Body, joints: &[[f32; 3]], hull: &HullFrames<'_>) -> Vec<f32> {
    let mut shape = vec![0.0; body.shape_components()];
    for round in 0..=ROUNDS {
        let (rest, vertices) = in_rest_pose(body, &shape, joints);
        let normals = normals(body, &vertices);
        let found = match round {
            0 => Vec::new(),
            _ => seen(body, &vertices, &normals, hull, SHAPE),
        };
        shape = solve(body, &shape, joints, &rest, &normals, &found);
    }
    shape
}

/// The vertices of the body, moved along its normals from where they are `bare` to what outlines tell, and by how much, metres.
fn with_clothes(
    body: &Body,
    bare: &[[f32; 3]],
    hull: &HullFrames<'_>,
) -> (Vec<[f32; 3]>, Vec<f32>) {
    let directions = normals(body, bare);
    let mut heights = vec![0f32; bare.len()];
    let mut vertices = bare.to_vec();
    for _ in 0..ROUNDS {
        let mut found = seen(body, &vertices, &normals(body, &vertices), hull, CLOTHES);
        (found.iter_mut()).for_each(|it| it.distance += heights[it.vertex]);
        heights = offsets(body, &found);
        vertices = (bare.iter().zip(&directions).zip(&heights))
            .map(|((at, normal), height)| std::array::from_fn(|a| at[a] + height * normal[a]))
            .collect();
    }
    (vertices, heights)
}

/// The outlines of a surface in the frames of `hull`.
fn seen(
    body: &Body,
    vertices: &[[f32; 3]],
    normals: &[[f32; 3]],
    hull: &HullFrames<'_>,
    search: Search,
) -> Vec<Outline> {
    let surface = RestSurface {
        body,
        vertices,
        normals,
    };
    let found = outlines(&surface, &hull.frames, hull.forgiven(), search);
    let sum: f32 = found.iter().map(|it| it.distance.abs()).sum();
    debug!(
        outlines = found.len(),
        off = sum / found.len().max(1) as f32
    );
    found
}

impl PersonSurface {
    /// `count` points, each with an equal share of the area that can be seen, and that area, square metres. Their spacing is not given.
    pub(super) fn points(&self, count: usize) -> (SurfacePoints, f64) {
        let body = Body::people();
        let shown = visible_faces(body);
        let area = areas(body, &self.vertices).into_iter().zip(shown);
        let area = area
            .filter(|(_, shown)| **shown)
            .map(|(area, _)| f64::from(area))
            .sum();
        let own = spread(body, &self.vertices, |face| shown[face], count);
        let points = SurfacePoints {
            points: own.iter().map(|it| it.of(body, &self.vertices)).collect(),
            normals: own
                .iter()
                .map(|it| unit(it.of(body, &self.normals)))
                .collect(),
            skinning: own.iter().map(|it| it.skinning(body)).collect(),
            spacing: Vec::new(),
        };
        (points, area)
    }
}

fn unit(v: [f32; 3]) -> [f32; 3] {
    let length = v.iter().map(|v| v * v).sum::<f32>().sqrt().max(1e-6);
    v.map(|v| v / length)
}

/// The body of the `shape` in the rest pose of joints `to`, without a person's offsets.
fn in_rest_pose(body: &Body, shape: &[f32], to: &[[f32; 3]]) -> (RestPose, Vec<[f32; 3]>) {
    let vertices = body.vertices(shape);
    let rest = RestPose::new(&body.joints_of(&vertices), to);
    let vertices = rest.apply(body, &vertices);
    (rest, vertices)
}
