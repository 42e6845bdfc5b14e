//! The colours of points by the frames that show them.

use super::hull::{HullFrame, HullFrames, Sighting};
use super::surface::points::SurfacePoints;
use yoto_ops::warp::inverse::solve::apply;

/// Cosine between normal and view above which a point's pixel has its colour.
const FACING: f32 = 0.3;
/// Coverage of pixels that have no background in them.
const WHOLE: u8 = 250;
/// The colour of each point, sRGB from 0 to 1: its mean in the frames that face it, by how much they do. `None` where there is no such
/// frame. Occlusion by the person's own surface and robust means change no training (docs/research/body.md).
pub(super) fn paint(hull: &HullFrames<'_>, points: &SurfacePoints) -> Vec<Option<[f32; 3]>> {
    // Σ f c and Σ f of colours c with cosines f to the view.
    let mut sums = vec![[0f32; 4]; points.points.len()];
    for frame in &hull.frames {
        let sightings = match points.skinning.as_slice() {
            [] => hull.sightings(&points.points, frame),
            skinning => hull.sightings_on_surface(&points.points, skinning, frame),
        };
        let places = points.points.iter().zip(&points.normals);
        for ((sum, sighting), (point, normal)) in sums.iter_mut().zip(sightings).zip(places) {
            let Some((pixel, facing)) = faces(frame, sighting, [*point, *normal]) else {
                continue;
            };
            let colour = &frame.image.rgb[3 * pixel..3 * pixel + 3];
            for (sum, value) in sum.iter_mut().zip(colour) {
                *sum += facing * f32::from(*value) / 255.0;
            }
            sum[3] += facing;
        }
    }
    let mean =
        |[r, g, b, weight]: [f32; 4]| (weight > 0.0).then(|| [r, g, b].map(|sum| sum / weight));
    sums.into_iter().map(mean).collect()
}

/// The pixel of a point with a normal, and the cosine to the view, if the frame shows it from the front.
fn faces(
    frame: &HullFrame,
    sighting: Sighting,
    [point, normal]: [[f32; 3]; 2],
) -> Option<(usize, f32)> {
    let pixel = sighting
        .pixel
        .filter(|pixel| frame.image.mask[*pixel] >= WHOLE)?;
    let t = &sighting.transform;
    let position = apply(t, point);
    let rotated: [f32; 3] = std::array::from_fn(|r| (0..3).map(|c| t[4 * r + c] * normal[c]).sum());
    let in_camera: [f32; 3] = std::array::from_fn(|r| {
        let row = frame.camera[r];
        row[0] * position[0] + row[1] * position[1] + row[2] * position[2] + row[3]
    });
    let normal: [f32; 3] =
        std::array::from_fn(|r| (0..3).map(|c| frame.camera[r][c] * rotated[c]).sum());
    let length = |v: [f32; 3]| v.iter().map(|v| v * v).sum::<f32>().sqrt().max(1e-6);
    let along: f32 = (0..3).map(|a| in_camera[a] * normal[a]).sum();
    let facing = -along / (length(in_camera) * length(normal));
    (facing > FACING).then_some((pixel, facing))
}
