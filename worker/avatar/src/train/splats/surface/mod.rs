//! The start of a person's splats on a body's surface: the shared body in the person's shape, by their bones and outlines, and
//! what outlines tell beyond the space of shapes.

mod between_legs;
pub(super) mod layer;
mod outline;
pub(super) mod points;
mod silhouette;
mod skirt;

use crate::train::splats::hull::HullFrames;
use outline::{RestSurface, Search, outlines};
use points::SurfacePoints;
pub(super) use skirt::Skirt;
use tracing::{debug, trace_span};
use yoto_body::Body;
use yoto_body::person::fit::{Stage, fit};
use yoto_body::person::mesh::areas;
use yoto_body::person::sample::spread;
use yoto_body::person::shape::Outline;
use yoto_body::person::visible::visible_faces;
use yoto_capture::skeleton::Skeleton;

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
    body: &'static Body,
    /// `[V, 3]`, metres.
    pub vertices: Vec<[f32; 3]>,
    /// `[V, 3]`, unit vectors, outward.
    pub normals: Vec<[f32; 3]>,
    /// What hangs over both legs, if the film shows that.
    pub skirt: Option<Skirt>,
}

impl PersonSurface {
    /// The surface of the person whom the frames of `hull` show.
    pub(super) fn new(body: &'static Body, skeleton: &Skeleton, hull: &HullFrames<'_>) -> Self {
        let _span = trace_span!("surface").entered();
        let joints: Vec<[f32; 3]> = (skeleton.rest.iter())
            .map(|at| at.map(|v| v as f32))
            .collect();
        let fitted = fit(body, &joints, |vertices, normals, stage| {
            let search = match stage {
                Stage::Shape => SHAPE,
                Stage::Clothes => CLOTHES,
            };
            seen(body, vertices, normals, hull, search)
        });
        Self {
            body,
            skirt: Skirt::find(body, &joints, &fitted, hull),
            normals: fitted.normals,
            vertices: fitted.vertices,
        }
    }
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
    /// `count` points, each with an equal share of the area that can be seen, and that area, square metres. Spacing and density are not given.
    pub(super) fn points(&self, count: usize) -> (SurfacePoints, f64) {
        let body = self.body;
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
            ..SurfacePoints::default()
        };
        (points, area)
    }
}

fn unit(v: [f32; 3]) -> [f32; 3] {
    let length = v.iter().map(|v| v * v).sum::<f32>().sqrt().max(1e-6);
    v.map(|v| v / length)
}
