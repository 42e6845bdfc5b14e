//! Correction of lens distortion, OpenCV's model of five coefficients.
//!
//! A point (x, y) on the plane one unit in front of the camera, with r² = x² + y², appears at
//! x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²) and
//! y' = y (1 + k1 r² + k2 r⁴ + k3 r⁶) + p1 (r² + 2 y²) + 2 p2 x y.

use crate::Picture;

/// Position of each pixel of an undistorted picture in the distorted one.
#[derive(Clone, Debug)]
pub struct Undistortion {
    width: usize,
    height: usize,
    k: [[f64; 3]; 3],
    coefficients: [f64; 5],
    /// Per pixel, column and row in the source, pixel centres at integers.
    from: Vec<[f32; 2]>,
}

impl Undistortion {
    /// For pictures of this size, intrinsics `k` (pixel centres at +0.5) and coefficients
    /// `[k1, k2, p1, p2, k3]`.
    pub fn new(width: usize, height: usize, k: [[f64; 3]; 3], coefficients: [f64; 5]) -> Self {
        let [[fx, skew, cx], [_, fy, cy], _] = k;
        let mut from = Vec::with_capacity(width * height);
        for row in 0..height {
            for column in 0..width {
                let y = (row as f64 + 0.5 - cy) / fy;
                let x = (column as f64 + 0.5 - cx - skew * y) / fx;
                let [x, y] = distort([x, y], coefficients);
                from.push([
                    (fx * x + skew * y + cx - 0.5) as f32,
                    (fy * y + cy - 0.5) as f32,
                ]);
            }
        }
        Self {
            width,
            height,
            k,
            coefficients,
            from,
        }
    }

    /// Whether the map is for this camera, and can be reused.
    pub fn fits(&self, width: usize, height: usize, k: [[f64; 3]; 3], with: [f64; 5]) -> bool {
        (self.width, self.height, self.k, self.coefficients) == (width, height, k, with)
    }

    /// The undistorted picture. Outside the source it is black and transparent.
    pub fn apply(&self, picture: &Picture) -> Picture {
        Picture {
            rgb: self.sample(&picture.rgb, 3),
            alpha: picture.alpha.as_ref().map(|alpha| self.sample(alpha, 1)),
            ..*picture
        }
    }

    /// The undistorted coverage `[height, width]`.
    pub fn apply_mask(&self, mask: &[u8]) -> Vec<u8> {
        self.sample(mask, 1)
    }

    /// Bilinear, with zeros around the source.
    fn sample(&self, source: &[u8], channels: usize) -> Vec<u8> {
        let mut out = Vec::with_capacity(self.from.len() * channels);
        for &[x, y] in &self.from {
            let (left, top) = (x.floor(), y.floor());
            let (right_share, bottom_share) = (x - left, y - top);
            for channel in 0..channels {
                let at = |dx: f32, dy: f32| {
                    let (column, row) = (left + dx, top + dy);
                    let inside = (0.0..self.width as f32).contains(&column)
                        && (0.0..self.height as f32).contains(&row);
                    if !inside {
                        return 0.0;
                    }
                    let pixel = row as usize * self.width + column as usize;
                    source
                        .get(pixel * channels + channel)
                        .map_or(0.0, |&v| f32::from(v))
                };
                let top = at(0.0, 0.0) * (1.0 - right_share) + at(1.0, 0.0) * right_share;
                let bottom = at(0.0, 1.0) * (1.0 - right_share) + at(1.0, 1.0) * right_share;
                let value = top * (1.0 - bottom_share) + bottom * bottom_share;
                out.push(value.round().clamp(0.0, 255.0) as u8);
            }
        }
        out
    }
}

/// Distorted position of the ideal position `[x, y]`.
pub fn distort([x, y]: [f64; 2], [k1, k2, p1, p2, k3]: [f64; 5]) -> [f64; 2] {
    let r2 = x * x + y * y;
    let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    [
        x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
        y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    const K: [[f64; 3]; 3] = [[80.0, 0.0, 40.0], [0.0, 80.0, 30.0], [0.0, 0.0, 1.0]];

    #[test]
    fn the_model_is_opencv_s() {
        // Computed by the formula above in double-precision Python.
        let [x, y] = distort([0.3, -0.2], [-0.2, 0.05, 0.001, -0.002, 0.01]);
        assert!((x - 0.291_720_091).abs() < 1e-12, "{x}");
        assert!((y + 0.194_523_394).abs() < 1e-12, "{y}");
    }

    #[test]
    fn a_dot_that_the_lens_moved_goes_back() {
        let coefficients = [-0.3, 0.1, 0.002, -0.001, 0.0];
        let (width, height) = (80, 60);
        let (column, row) = (62.0, 12.0);
        let ideal = [(column + 0.5 - 40.0) / 80.0, (row + 0.5 - 30.0) / 80.0];
        let [x, y] = distort(ideal, coefficients);
        let seen = [80.0 * x + 40.0 - 0.5, 80.0 * y + 30.0 - 0.5];
        let moved = ((seen[0] - column).powi(2) + (seen[1] - row).powi(2)).sqrt();
        assert!(moved > 1.0, "the test's lens moves it by {moved}");
        let mask: Vec<u8> = (0..width * height)
            .map(|i| {
                let (dx, dy) = ((i % width) as f64 - seen[0], (i / width) as f64 - seen[1]);
                (255.0 * (-0.5 * (dx * dx + dy * dy)).exp()) as u8
            })
            .collect();
        let undone = Undistortion::new(width, height, K, coefficients).apply_mask(&mask);
        let (mut sum, mut at) = (0.0, [0.0; 2]);
        for (i, &v) in undone.iter().enumerate() {
            sum += f64::from(v);
            at[0] += f64::from(v) * (i % width) as f64;
            at[1] += f64::from(v) * (i / width) as f64;
        }
        let found = at.map(|v| v / sum);
        assert!(
            (found[0] - column).abs() < 0.15 && (found[1] - row).abs() < 0.15,
            "{found:?}"
        );
    }

    #[test]
    fn no_distortion_changes_nothing() {
        let picture = Picture {
            width: 80,
            height: 60,
            rgb: (0..80 * 60 * 3).map(|i| (i % 251) as u8).collect(),
            alpha: None,
            lossy: false,
        };
        let same = Undistortion::new(80, 60, K, [0.0; 5]).apply(&picture);
        assert_eq!(same, picture);
    }
}
