//! Rendering of a posed body by sphere tracing, with coverage by supersampling.

use super::body::{BLEND, PosedBody, PosedCapsule};
use rayon::prelude::*;
use yoto_capture::FrameImage;
use yoto_capture::camera::Camera;
use yoto_capture::skeleton::Vec3;
use yoto_capture::skeleton::transform::{add, dot, length, normalised, scale, sub};

/// Rays per pixel and axis.
const SAMPLES: usize = 3;
/// Largest distance of a point on the surface, metres.
const ON_SURFACE: f64 = 5e-4;
/// Capsules farther away don't change the surface at a point, metres.
const REACH: f64 = 1.3 * BLEND;
/// Largest distance of a blended surface from its capsules, metres.
const BULGE: f64 = 0.5 * BLEND;
/// Step of a ray as a share of the distance, since distances are slightly too large on tapered capsules. For
/// moving clothes, it is divided by their stretch.
const STEP: f64 = 0.95;
const MAX_STEPS: usize = 160;

/// The region of the image that a capsule can affect: a thick line, pixels.
struct Outline {
    from: [f64; 2],
    to: [f64; 2],
    /// Half the width of the region where a ray can hit it.
    solid: f64,
    /// Half the width of the region where it can change another capsule's surface.
    reach: f64,
}

impl Outline {
    /// The region of a capsule; `None` if it is so near to the camera that it may appear anywhere.
    fn of(capsule: &PosedCapsule<'_>, camera: &Camera) -> Option<Self> {
        let thick = capsule.thickness;
        let centre = camera.centre();
        let focal = camera.k[0][0].max(camera.k[1][1]);
        let forward: Vec3 = std::array::from_fn(|i| camera.e[2][i]);
        // Pixels per metre: larger near the camera, and off its axis, where spheres are elongated.
        let magnified = |p: Vec3| {
            let towards = sub(p, centre);
            let depth = dot(towards, forward) - thick - REACH;
            (depth > 0.05).then(|| focal * dot(towards, towards) / depth.powi(3))
        };
        let magnification = magnified(capsule.from)?.max(magnified(capsule.to)?);
        Some(Self {
            from: camera.project(capsule.from)?,
            to: camera.project(capsule.to)?,
            solid: magnification * (thick + BULGE) + 1.0,
            reach: magnification * (thick + REACH) + 1.0,
        })
    }

    /// Squared distance of a pixel from the capsule's axis.
    fn squared_distance(&self, u: f64, v: f64) -> f64 {
        let axis = [self.to[0] - self.from[0], self.to[1] - self.from[1]];
        let p = [u - self.from[0], v - self.from[1]];
        let squared = axis[0] * axis[0] + axis[1] * axis[1];
        let share = if squared > 0.0 {
            ((p[0] * axis[0] + p[1] * axis[1]) / squared).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let off = [p[0] - share * axis[0], p[1] - share * axis[1]];
        off[0] * off[0] + off[1] * off[1]
    }
}

/// Fills `near` with the capsules that can affect a pixel, or with none if no ray can hit anything.
fn gather(outlines: &[Option<Outline>], near: &mut Vec<usize>, u: f64, v: f64) {
    near.clear();
    let mut solid = false;
    for (index, outline) in outlines.iter().enumerate() {
        let Some(outline) = outline else {
            near.push(index);
            solid = true;
            continue;
        };
        let squared = outline.squared_distance(u, v);
        if squared < outline.reach * outline.reach {
            near.push(index);
            solid |= squared < outline.solid * outline.solid;
        }
    }
    if !solid {
        near.clear();
    }
}

/// The image of the body by `camera`, premultiplied by coverage.
pub(crate) fn render(body: &PosedBody<'_>, camera: &Camera) -> FrameImage {
    let (width, height) = (camera.width as usize, camera.height as usize);
    let mut image = FrameImage::empty(width, height);
    let outlines: Vec<Option<Outline>> = body
        .capsules
        .iter()
        .map(|capsule| Outline::of(capsule, camera))
        .collect();
    let rows = image.rgb.par_chunks_mut(width * 3);
    rows.zip(image.mask.par_chunks_mut(width))
        .enumerate()
        .for_each_init(Vec::new, |near: &mut Vec<usize>, (row, (rgb, mask))| {
            for column in 0..width {
                let (u, v) = (column as f64, row as f64);
                gather(&outlines, near, u + 0.5, v + 0.5);
                if near.is_empty() {
                    continue;
                }
                let (colour, coverage) = pixel(body, camera, near, u, v);
                for (target, value) in rgb[column * 3..].iter_mut().zip(colour) {
                    *target = (value * 255.0).round() as u8;
                }
                mask[column] = (coverage * 255.0).round() as u8;
            }
        });
    image
}

/// Premultiplied colour and coverage of the pixel with its upper left corner at (u, v).
fn pixel(body: &PosedBody<'_>, camera: &Camera, near: &[usize], u: f64, v: f64) -> (Vec3, f64) {
    let offset = |i: usize| (i as f64 + 0.5) / SAMPLES as f64;
    let share = 1.0 / (SAMPLES * SAMPLES) as f64;
    let mut colour = [0.0; 3];
    let mut hits = 0u32;
    for i in 0..SAMPLES * SAMPLES {
        let (origin, direction) = camera.ray(u + offset(i % SAMPLES), v + offset(i / SAMPLES));
        if let Some(point) = first_hit(body, near, origin, normalised(direction)) {
            colour = add(colour, scale(body.colour(point, near), share));
            hits += 1;
        }
    }
    let coverage = f64::from(hits) * share;
    // A premultiplied colour is at most its coverage; rounding of the sums must not change that.
    (colour.map(|v| v.min(coverage)), coverage)
}

pub(crate) fn first_hit(
    body: &PosedBody<'_>,
    near: &[usize],
    origin: Vec3,
    direction: Vec3,
) -> Option<Vec3> {
    let (mut from, mut to) = (f64::INFINITY, f64::NEG_INFINITY);
    for &index in near {
        let capsule = &body.capsules[index];
        let half = scale(sub(capsule.to, capsule.from), 0.5);
        let middle = dot(sub(add(capsule.from, half), origin), direction);
        let radius = length(half) + capsule.thickness + BLEND;
        from = from.min(middle - radius);
        to = to.max(middle + radius);
    }
    let share = STEP / body.stretch;
    let mut at = from.max(0.0);
    for _ in 0..MAX_STEPS {
        if at > to {
            return None;
        }
        let point = add(origin, scale(direction, at));
        let distance = body.distance(point, near);
        if distance < ON_SURFACE {
            return Some(point);
        }
        at += share * distance;
    }
    None
}
