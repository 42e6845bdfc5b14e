//! The silhouette of a person's surface in a frame: its points, drawn as discs that overlap.

use super::outline::{blend, forward};
use super::points::SurfacePoints;
use crate::train::splats::hull::HullFrame;
use rayon::prelude::*;
use yoto_ops::warp::inverse::solve::apply;

/// Cells per pixel along each axis.
const FINER: usize = 3;
/// Radius of a disc in distances of points, so that discs of neighbours overlap, and what it has beyond that, metres: poses and masks are
/// not exact.
const OVERLAP: f32 = 0.7;
const MARGIN: f32 = 0.008;

/// Share of the frames in which a point must be outside of the silhouette.
const OUTSIDE: f64 = 0.05;

/// Whether each of the `points` is outside of the silhouette of the person's `own` surface in enough of the `frames`. Only points of that
/// surface that are `kept` are drawn, which are `apart` metres from each other. Nothing tells of a point inside of it in nearly all
/// frames that it is part of the person, and not where a hull is too large.
pub(super) fn outside(
    points: &[[f32; 3]],
    skinning: &[[(u8, f32); 4]],
    (own, kept): (&SurfacePoints, &[bool]),
    apart: f64,
    frames: &[HullFrame],
) -> Vec<bool> {
    let mut counts = vec![[0usize; 2]; points.len()];
    for frame in frames {
        let forward = forward(frame);
        let silhouette = Silhouette::of((own, kept), apart, frame, &forward);
        counts.par_iter_mut().enumerate().for_each(|(i, count)| {
            let transform = blend(&forward, skinning[i].into_iter());
            let posed = apply(&transform, points[i]);
            if let Some(covered) = silhouette.covers(frame.project(posed)) {
                count[0] += 1;
                count[1] += usize::from(!covered);
            }
        });
    }
    let enough = |[shown, outside]: [usize; 2]| outside as f64 > OUTSIDE * shown as f64;
    counts.into_iter().map(enough).collect()
}

/// The cells of a picture that a surface covers.
struct Silhouette {
    width: usize,
    height: usize,
    covered: Vec<bool>,
}

impl Silhouette {
    /// The silhouette of those points in a frame that are `kept`, `apart` metres from each other. Bones have the transforms `forward` to
    /// the posed body.
    fn of(
        (points, kept): (&SurfacePoints, &[bool]),
        apart: f64,
        frame: &HullFrame,
        forward: &[[f32; 12]],
    ) -> Self {
        let (width, height) = (FINER * frame.image.width, FINER * frame.image.height);
        let mut silhouette = Self {
            width,
            height,
            covered: vec![false; width * height],
        };
        for i in (0..points.points.len()).filter(|i| kept[*i]) {
            let posed = apply(
                &blend(forward, points.skinning[i].into_iter()),
                points.points[i],
            );
            let radius = MARGIN + OVERLAP * apart as f32;
            silhouette.add(frame.project(posed), radius * frame.focal);
        }
        silhouette
    }

    /// Draws a disc around a point in pixels at a depth. Its radius is given in pixels at a depth of one metre.
    fn add(&mut self, [x, y, depth]: [f32; 3], radius: f32) {
        if depth.is_nan() || depth <= 0.0 {
            return;
        }
        let [x, y, radius] = [x, y, radius / depth].map(|v| FINER as f32 * v);
        let range = |at: f32, size: usize| {
            (at - radius).max(0.0) as usize..((at + radius).max(0.0) as usize + 1).min(size)
        };
        for row in range(y, self.height) {
            for column in range(x, self.width) {
                let (dx, dy) = (column as f32 + 0.5 - x, row as f32 + 0.5 - y);
                self.covered[row * self.width + column] |= dx * dx + dy * dy < radius * radius;
            }
        }
    }

    /// Whether a point in pixels at a depth is inside; `None` if it is outside of the picture.
    fn covers(&self, [x, y, depth]: [f32; 3]) -> Option<bool> {
        let [x, y] = [x, y].map(|v| FINER as f32 * v);
        // Comparisons are false for a NaN.
        let shown =
            depth > 0.0 && x >= 0.0 && y >= 0.0 && x < self.width as f32 && y < self.height as f32;
        shown.then(|| self.covered[y as usize * self.width + x as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_disc_is_smaller_farther_away_and_cut_at_the_border() {
        let mut silhouette = Silhouette {
            width: FINER * 20,
            height: FINER * 10,
            covered: vec![false; FINER * 20 * FINER * 10],
        };
        silhouette.add([5.0, 5.0, 1.0], 4.0);
        silhouette.add([15.0, 5.0, 2.0], 4.0);
        silhouette.add([10.0, -1.0, 1.0], 2.5);
        silhouette.add([10.0, 8.0, -1.0], 4.0);
        silhouette.add([f32::NAN, 8.0, f32::NAN], 4.0);
        let covers = |x, y| silhouette.covers([x, y, 1.0]);
        assert_eq!(covers(8.5, 5.0), Some(true));
        assert_eq!(covers(12.5, 5.0), Some(false));
        assert_eq!(covers(13.5, 5.0), Some(true));
        assert_eq!(covers(10.0, 0.5), Some(true));
        assert_eq!(covers(10.0, 8.0), Some(false), "behind the camera");
        assert_eq!(covers(20.0, 5.0), None);
        assert_eq!(silhouette.covers([5.0, 5.0, -1.0]), None);
    }

    #[test]
    fn a_point_that_is_always_before_the_body_tells_nothing_of_the_person() {
        let bones = [(0u8, 1.0f32), (0, 0.0), (0, 0.0), (0, 0.0)];
        let mut own = SurfacePoints::default();
        for i in 0..400 {
            let at = [i % 20, i / 20].map(|cell| 0.02 * (cell as f32 - 9.5));
            own.points.push([at[0], at[1], 3.0]);
            own.skinning.push(bones);
        }
        let frames = [HullFrame::along_z(100, 200.0)];
        let outside = |kept: bool| {
            let points = [[0.0, 0.0, 2.8], [0.3, 0.0, 3.0], [9.0, 0.0, 3.0]];
            outside(&points, &[bones; 3], (&own, &[kept; 400]), 0.02, &frames)
        };
        assert_eq!(
            outside(true),
            [false, true, false],
            "the last is in no picture"
        );
        assert_eq!(outside(false), [true, true, false]);
    }
}
