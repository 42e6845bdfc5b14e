//! The silhouette of a person's surface in a frame: its points, drawn as discs that overlap.

use super::outline::blend;
use super::points::SurfacePoints;
use crate::train::splats::hull::HullFrame;
use yoto_ops::warp::inverse::solve::apply;

/// Cells per pixel along each axis.
const FINER: usize = 3;
/// Radius of a disc in distances of points, so that discs of neighbours overlap, and what it has beyond that, metres: poses and masks are
/// not exact.
const OVERLAP: f32 = 0.7;
const MARGIN: f32 = 0.008;

/// The cells of a picture that a surface covers.
pub(super) struct Silhouette {
    width: usize,
    height: usize,
    covered: Vec<bool>,
}

impl Silhouette {
    /// The silhouette of those `points` in a frame that are `kept`. Bones have the transforms `forward` to the posed body.
    pub(super) fn of(
        points: &SurfacePoints,
        kept: &[bool],
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
            let radius = MARGIN + OVERLAP * points.spacing[i] as f32;
            silhouette.add(frame.project(posed), radius * frame.focal());
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
    pub(super) fn covers(&self, [x, y, depth]: [f32; 3]) -> Option<bool> {
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
}
