//! Points of a person's surface in the training frames: which pixels show them from the front, and which points the rest of the surface
//! hides in every frame.

use super::hull::{HullFrame, HullFrames, Sighting};
use super::surface::points::SurfacePoints;
use rayon::prelude::*;
use std::collections::HashMap;
use yoto_ops::warp::inverse::solve::apply;

/// What it takes for a frame to show a point.
#[derive(Clone, Copy)]
struct Shown {
    /// Least cosine between normal and view.
    facing: f32,
    /// Least coverage of the pixel.
    coverage: u8,
}

/// The pixel has the colour of the point, without background.
const COLOUR: Shown = Shown {
    facing: 0.3,
    coverage: 250,
};
/// The point is on the side of the person that faces the camera, or at the outline.
const OUTLINE: Shown = Shown {
    facing: 0.15,
    coverage: 100,
};
/// Width of a cell of a depth map, as a multiple of the distance between points, so that a surface has no holes in it.
const CELL: f64 = 2.5;
/// How far behind the surface a point counts as on it, metres, on top of what the surface's slope makes of a cell.
const BEHIND: f32 = 0.01;

/// A point that a pixel of a frame shows from the front, unless something hides it.
#[derive(Clone, Copy)]
struct View {
    pixel: usize,
    /// Cosine between normal and view.
    facing: f32,
    /// In the camera's frame, metres.
    at: [f32; 3],
}

/// Σ f c and Σ f of the colours c of each point in the frames that face it, where f is the cosine to the view.
pub(super) fn colour_sums(hull: &HullFrames<'_>, points: &SurfacePoints) -> Vec<[f32; 4]> {
    let mut sums = vec![[0f32; 4]; points.points.len()];
    for frame in &hull.frames {
        let views = views(hull, frame, points, COLOUR);
        for (sum, view) in sums.iter_mut().zip(views) {
            let Some(view) = view else {
                continue;
            };
            let colour = &frame.image.rgb[3 * view.pixel..3 * view.pixel + 3];
            for (sum, value) in sum.iter_mut().zip(colour) {
                *sum += view.facing * f32::from(*value) / 255.0;
            }
            sum[3] += view.facing;
        }
    }
    sums
}

/// Whether a frame shows each of the `points` from the front or at the outline, unless something hides it.
pub(super) fn faced(hull: &HullFrames<'_>, points: &SurfacePoints) -> Vec<bool> {
    let mut faced = vec![false; points.points.len()];
    for frame in &hull.frames {
        let views = views(hull, frame, points, OUTLINE);
        (faced.iter_mut().zip(views)).for_each(|(faced, view)| *faced |= view.is_some());
    }
    faced
}

/// Whether a frame shows each point of the two parts of a surface, which hide each other. Points are `apart` metres from each other.
/// Those of the first part that are not `kept` hide nothing.
pub(super) fn shown(
    hull: &HullFrames<'_>,
    parts: [&SurfacePoints; 2],
    kept: &[bool],
    apart: f64,
) -> [Vec<bool>; 2] {
    let cell = (CELL * apart) as f32;
    let mut shown = parts.map(|part| vec![false; part.points.len()]);
    for frame in &hull.frames {
        let views = parts.map(|part| views(hull, frame, part, COLOUR));
        let [own, beside] = &views;
        let kept = own.iter().zip(kept).filter(|(_, kept)| **kept);
        let all = kept.map(|(view, _)| view).chain(beside).flatten();
        let map = DepthMap::new(all, cell);
        for (shown, views) in shown.iter_mut().zip(&views) {
            for (shown, view) in shown.iter_mut().zip(views) {
                *shown |= view.as_ref().is_some_and(|view| map.shows(view));
            }
        }
    }
    shown
}

/// Each of the `points` in a frame, if it shows it from the front.
fn views(
    hull: &HullFrames<'_>,
    frame: &HullFrame,
    points: &SurfacePoints,
    bounds: Shown,
) -> Vec<Option<View>> {
    let sightings = match points.skinning.as_slice() {
        [] => hull.sightings(&points.points, frame),
        skinning => hull.sightings_on_surface(&points.points, skinning, frame),
    };
    (points.points.par_iter().zip(&points.normals))
        .zip(sightings)
        .map(|((point, normal), sighting)| view(frame, sighting, *point, *normal, bounds))
        .collect()
}

/// A `point` with a `normal` in a frame, if it shows it from the front.
fn view(
    frame: &HullFrame,
    sighting: Sighting,
    point: [f32; 3],
    normal: [f32; 3],
    bounds: Shown,
) -> Option<View> {
    let pixel = sighting
        .pixel
        .filter(|pixel| frame.image.mask[*pixel] >= bounds.coverage)?;
    let t = &sighting.transform;
    let position = apply(t, point);
    let rotated: [f32; 3] = std::array::from_fn(|r| (0..3).map(|c| t[4 * r + c] * normal[c]).sum());
    let at: [f32; 3] = std::array::from_fn(|r| {
        let row = frame.camera[r];
        row[0] * position[0] + row[1] * position[1] + row[2] * position[2] + row[3]
    });
    let normal: [f32; 3] =
        std::array::from_fn(|r| (0..3).map(|c| frame.camera[r][c] * rotated[c]).sum());
    let length = |v: [f32; 3]| v.iter().map(|v| v * v).sum::<f32>().sqrt().max(1e-6);
    let along: f32 = (0..3).map(|a| at[a] * normal[a]).sum();
    let facing = -along / (length(at) * length(normal));
    (facing > bounds.facing).then_some(View { pixel, facing, at })
}

/// The least depth of a surface along lines of sight.
struct DepthMap {
    /// Width of a cell at the surface's mean depth, metres, and that depth.
    cell: f32,
    depth: f32,
    nearest: HashMap<[i32; 2], f32>,
}

impl DepthMap {
    /// Of `views` of a surface in one frame, in cells `cell` metres wide.
    fn new<'a>(views: impl Iterator<Item = &'a View> + Clone, cell: f32) -> Self {
        let (count, sum) =
            (views.clone()).fold((0, 0.0), |(n, sum), view| (n + 1, sum + view.at[2]));
        let mut map = Self {
            cell,
            depth: sum / count.max(1) as f32,
            nearest: HashMap::new(),
        };
        for view in views {
            let nearest = map
                .nearest
                .entry(map.cell_of(view))
                .or_insert(f32::INFINITY);
            *nearest = nearest.min(view.at[2]);
        }
        map
    }

    fn cell_of(&self, view: &View) -> [i32; 2] {
        let [x, y, z] = view.at;
        [x, y].map(|across| (across / z * self.depth / self.cell).floor() as i32)
    }

    /// Whether nothing is before the point. A surface with the slope tan φ has points in its own cell that are `cell` · tan φ nearer, and
    /// tan φ < 1 / cos φ.
    fn shows(&self, view: &View) -> bool {
        let nearest = self.nearest.get(&self.cell_of(view)).copied();
        let own = BEHIND + self.cell / view.facing;
        nearest.is_none_or(|nearest| view.at[2] - nearest < own)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f32, z: f32) -> View {
        View {
            pixel: 0,
            facing: 0.5,
            at: [x, 0.0, z],
        }
    }

    #[test]
    fn what_is_behind_a_surface_is_hidden_and_a_slope_hides_nothing_of_itself() {
        // A slope of 60 degrees.
        let slope: Vec<View> = (0..100)
            .map(|i| at(0.001 * i as f32, 3.0 + 0.001_73 * i as f32))
            .collect();
        let map = DepthMap::new(slope.iter(), 0.02);
        assert!(slope.iter().all(|view| map.shows(view)));
        assert!(!map.shows(&at(0.05, 3.2)));
        assert!(map.shows(&at(0.5, 3.2)), "beside the surface");
    }
}
