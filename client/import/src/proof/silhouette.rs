//! The agreement of a body with a mask: projected joints lie inside the mask and extend over it.
//!
//! The figure is the share of points along the bones that lie inside the mask, times how well the box
//! around them, widened by what flesh adds, agrees with the mask's box (their intersection over their
//! union). A body of the wrong size or position loses one or the other.

use crate::geometry::{Vec3, add, scale};
use crate::track::Camera;

/// Longest side of a mask in a proof, pixels: larger ones are subsampled.
const SIDE: usize = 480;
/// Least figure of a reading that is believed.
pub(crate) const LEAST: f64 = 0.45;
/// Margins of flesh around the box of joints: above, below and at the sides, shares of its longer side.
const FLESH: [f64; 3] = [0.1, 0.03, 0.03];
/// Points along each bone.
const POINTS: usize = 3;

/// A mask, thinned out.
pub(crate) struct Silhouette {
    width: usize,
    height: usize,
    /// Pixels of the clip between two of these.
    step: f64,
    inside: Vec<bool>,
    /// x0, y0, x1, y1 in the clip's pixels.
    bounds: [f64; 4],
}

impl Silhouette {
    /// The silhouette in the levels of a mask; `None` for an empty mask.
    pub(super) fn new(levels: &[u8], [width, height]: [u32; 2]) -> Option<Self> {
        let (across, down) = (width as usize, height as usize);
        let step = across.max(down).div_ceil(SIDE).max(1);
        let (width, height) = (across.div_ceil(step), down.div_ceil(step));
        let at = |x: usize, y: usize| levels.get(y * step * across + x * step);
        let mut inside = Vec::with_capacity(width * height);
        let mut bounds = [f64::MAX, f64::MAX, f64::MIN, f64::MIN];
        for y in 0..height {
            for x in 0..width {
                let covered = at(x, y).is_some_and(|level| *level >= 128);
                inside.push(covered);
                if covered {
                    let (x, y) = ((x * step) as f64, (y * step) as f64);
                    bounds = [
                        bounds[0].min(x),
                        bounds[1].min(y),
                        bounds[2].max(x + step as f64),
                        bounds[3].max(y + step as f64),
                    ];
                }
            }
        }
        (bounds[2] > bounds[0]).then_some(Self {
            width,
            height,
            step: step as f64,
            inside,
            bounds,
        })
    }

    /// Pixels of the clip inside.
    pub(super) fn area(&self) -> f64 {
        let inside = self.inside.iter().filter(|covered| **covered).count();
        inside as f64 * self.step * self.step
    }

    fn has(&self, [x, y]: [f64; 2]) -> bool {
        if x < 0.0 || y < 0.0 {
            return false;
        }
        let (x, y) = ((x / self.step) as usize, (y / self.step) as usize);
        x < self.width && y < self.height && self.inside.get(y * self.width + x) == Some(&true)
    }
}

/// The agreement of `joints`, each with its parent, with a mask, 0 to 1.
pub(crate) fn agreement_of(
    joints: &[Vec3],
    parents: impl Iterator<Item = Option<usize>>,
    camera: &Camera,
    mask: &Silhouette,
    size: [u32; 2],
) -> f64 {
    let project = |p: Vec3| {
        let e = camera.e;
        let [x, y, z] = [0, 1, 2].map(|i: usize| {
            let row = e[i];
            row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3]
        });
        let k = camera.k;
        (z > 0.05).then(|| [k[0][0] * x / z + k[0][2], k[1][1] * y / z + k[1][2]])
    };
    let mut points = Vec::new();
    for (parent, joint) in parents.zip(joints) {
        let Some(above) = parent.and_then(|parent| joints.get(parent)) else {
            continue;
        };
        for part in 1..=POINTS {
            let share = part as f64 / POINTS as f64;
            let point = add(scale(*above, 1.0 - share), scale(*joint, share));
            match project(point) {
                Some(pixel) => points.push(pixel),
                None => return 0.0,
            }
        }
    }
    let [width, height] = size.map(f64::from);
    let is_seen = |p: &&[f64; 2]| p[0] >= 0.0 && p[1] >= 0.0 && p[0] < width && p[1] < height;
    let seen_points = points.iter().filter(is_seen);
    // Points outside of the picture can't be in the mask; a body mostly outside proves nothing.
    let visible = seen_points.clone().count();
    if 3 * visible < points.len() {
        return 0.0;
    }
    let inside = seen_points.filter(|point| mask.has(**point)).count();
    let mut bounds = [f64::MAX, f64::MAX, f64::MIN, f64::MIN];
    for [x, y] in &points {
        bounds = [
            bounds[0].min(*x),
            bounds[1].min(*y),
            bounds[2].max(*x),
            bounds[3].max(*y),
        ];
    }
    let longer = (bounds[2] - bounds[0]).max(bounds[3] - bounds[1]);
    let [above, below, beside] = FLESH.map(|share| share * longer);
    let body = [
        (bounds[0] - beside).max(0.0),
        (bounds[1] - above).max(0.0),
        (bounds[2] + beside).min(width),
        (bounds[3] + below).min(height),
    ];
    inside as f64 / visible as f64 * overlap(body, mask.bounds)
}

/// Intersection over union of two boxes.
fn overlap(a: [f64; 4], b: [f64; 4]) -> f64 {
    let area = |[x0, y0, x1, y1]: [f64; 4]| (x1 - x0).max(0.0) * (y1 - y0).max(0.0);
    let both = area([
        a[0].max(b[0]),
        a[1].max(b[1]),
        a[2].min(b[2]),
        a[3].min(b[3]),
    ]);
    let either = area(a) + area(b) - both;
    if either > 0.0 { both / either } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_overlap_by_their_shares() {
        assert_eq!(
            overlap([0.0, 0.0, 2.0, 2.0], [1.0, 0.0, 3.0, 2.0]),
            1.0 / 3.0
        );
        assert_eq!(overlap([0.0, 0.0, 1.0, 1.0], [2.0, 0.0, 3.0, 1.0]), 0.0);
    }

    #[test]
    fn silhouettes_keep_their_place_when_thinned_out() {
        let (width, height) = (1000, 40);
        let mut levels = vec![0; width * height];
        for y in 10..20 {
            levels[y * width + 600..y * width + 700].fill(255);
        }
        let mask = Silhouette::new(&levels, [1000, 40]).expect("somebody");
        assert!(mask.has([650.0, 15.0]) && !mask.has([590.0, 15.0]) && !mask.has([-5.0, 15.0]));
        let wanted = [600.0, 10.0, 700.0, 20.0];
        let off = mask.bounds.iter().zip(wanted).map(|(a, b)| (a - b).abs());
        assert!(off.fold(0.0, f64::max) <= 3.0, "{:?}", mask.bounds);
        assert!(Silhouette::new(&[0; 4], [2, 2]).is_none());
    }
}
