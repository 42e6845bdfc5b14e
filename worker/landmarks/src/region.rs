//! Rotated squares of a picture, the model's input.

use rayon::prelude::*;
use std::f32::consts::{FRAC_PI_2, PI};

/// A picture: 8-bit RGB, row by row.
#[derive(Clone, Copy, Debug)]
pub(crate) struct View<'a> {
    /// `[height, width, 3]`.
    pub(crate) rgb: &'a [u8],
    pub(crate) width: usize,
    pub(crate) height: usize,
}

/// A square of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Region {
    /// Centre, pixels from the picture's corner.
    pub(crate) centre: [f32; 2],
    /// Side, pixels.
    pub(crate) side: f32,
    /// Angle from upright, radians, clockwise in the picture.
    pub(crate) angle: f32,
}

/// The colour beyond the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Beyond {
    Black,
    /// The nearest pixel.
    Nearest,
}

/// Margin around a body that the landmark model expects.
pub(crate) const MARGIN: f32 = 1.25;

impl Region {
    /// The smallest upright square around a whole picture.
    pub(crate) fn whole(width: usize, height: usize) -> Self {
        Self {
            centre: [width as f32 / 2.0, height as f32 / 2.0],
            side: width.max(height) as f32,
            angle: 0.0,
        }
    }

    /// The square around a body, from the middle of its hips and the point straight above the head on the circle around
    /// the whole body. `None` if they are not finite or too close.
    pub(crate) fn around(hips: [f32; 2], circle: [f32; 2]) -> Option<Self> {
        let [dx, dy] = [circle[0] - hips[0], circle[1] - hips[1]];
        let angle = FRAC_PI_2 - (-dy).atan2(dx);
        let square = Self {
            centre: hips,
            side: 2.0 * MARGIN * dx.hypot(dy),
            angle: angle - 2.0 * PI * ((angle + PI) / (2.0 * PI)).floor(),
        };
        square.possible()
    }

    /// The position in the picture, pixels, of a position in the square, from 0 to 1.
    pub(crate) fn to_picture(self, [u, v]: [f32; 2]) -> [f32; 2] {
        let [x, y] = self.rotate([(u - 0.5) * self.side, (v - 0.5) * self.side]);
        [self.centre[0] + x, self.centre[1] + y]
    }

    /// The position in the square, from 0 to 1, of a position in the picture, pixels.
    #[cfg(test)]
    pub(crate) fn to_square(self, position: [f32; 2]) -> [f32; 2] {
        self.squares()(position)
    }

    /// The map from positions in the picture, pixels, to positions in the square, from 0 to 1.
    pub(crate) fn squares(self) -> impl Fn([f32; 2]) -> [f32; 2] {
        let (sin, cos) = self.angle.sin_cos();
        move |[x, y]| {
            let [x, y] = [x - self.centre[0], y - self.centre[1]];
            [
                (cos * x + sin * y) / self.side + 0.5,
                (cos * y - sin * x) / self.side + 0.5,
            ]
        }
    }

    /// A direction in the picture's axes, from the square's.
    pub(crate) fn rotate(self, [x, y]: [f32; 2]) -> [f32; 2] {
        let (sin, cos) = self.angle.sin_cos();
        [cos * x - sin * y, sin * x + cos * y]
    }

    /// The box around `points` in the axes of squares at `angle`: its middle in the picture, its width and its height, pixels.
    pub(crate) fn box_around(
        points: impl Iterator<Item = [f32; 2]>,
        angle: f32,
    ) -> ([f32; 2], [f32; 2]) {
        let (sin, cos) = angle.sin_cos();
        let (mut low, mut high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        for [x, y] in points {
            for (axis, at) in [cos * x + sin * y, cos * y - sin * x]
                .into_iter()
                .enumerate()
            {
                low[axis] = low[axis].min(at);
                high[axis] = high[axis].max(at);
            }
        }
        let [x, y] = [0, 1].map(|axis| 0.5 * (low[axis] + high[axis]));
        let middle = [cos * x - sin * y, sin * x + cos * y];
        (middle, [0, 1].map(|axis| high[axis] - low[axis]))
    }

    /// This square, if it is one of a picture: of a pixel at least, and not so far away that f32 is too coarse for single pixels.
    pub(crate) fn possible(self) -> Option<Self> {
        let is_near = self.centre.iter().all(|at| at.abs() < 1e6);
        (is_near && (1.0..1e6).contains(&self.side) && self.angle.is_finite()).then_some(self)
    }

    /// Samples the square as `[pixels, pixels, 3]`, with `range[0]` for black and `range[1]` for white.
    pub(crate) fn cut(
        self,
        view: View,
        pixels: usize,
        range: [f32; 2],
        beyond: Beyond,
        out: &mut [f32],
    ) {
        let scale = (range[1] - range[0]) / 255.0;
        let lines = out.par_chunks_exact_mut(pixels * 3).enumerate();
        lines.for_each(|(row, line)| {
            for (column, out) in line.as_chunks_mut::<3>().0.iter_mut().enumerate() {
                let uv = [column, row].map(|at| (at as f32 + 0.5) / pixels as f32);
                let colour = view.bilinear(self.to_picture(uv), beyond);
                *out = colour.map(|level| range[0] + level * scale);
            }
        });
    }
}

impl View<'_> {
    /// The colour at a position, from 0 to 255, interpolated between the four nearest pixels.
    fn bilinear(&self, [x, y]: [f32; 2], beyond: Beyond) -> [f32; 3] {
        let [x, y] = [x - 0.5, y - 0.5];
        let [left, top] = [x.floor(), y.floor()];
        let [right, down] = [x - left, y - top];
        let mut colour = [0.0; 3];
        for (dx, dy, share) in [
            (0.0, 0.0, (1.0 - right) * (1.0 - down)),
            (1.0, 0.0, right * (1.0 - down)),
            (0.0, 1.0, (1.0 - right) * down),
            (1.0, 1.0, right * down),
        ] {
            let pixel = self.pixel(left + dx, top + dy, beyond);
            for (sum, level) in colour.iter_mut().zip(pixel) {
                *sum += share * f32::from(level);
            }
        }
        colour
    }

    fn pixel(&self, x: f32, y: f32, beyond: Beyond) -> [u8; 3] {
        let last = [self.width as f32 - 1.0, self.height as f32 - 1.0];
        let inside = (0.0..=last[0]).contains(&x) && (0.0..=last[1]).contains(&y);
        if !inside && beyond == Beyond::Black {
            return [0; 3];
        }
        let [x, y] = [
            x.clamp(0.0, last[0]) as usize,
            y.clamp(0.0, last[1]) as usize,
        ];
        let (pixels, _) = self.rgb.as_chunks::<3>();
        pixels.get(y * self.width + x).copied().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_body_upright_has_an_upright_square() {
        let region = Region::around([100.0, 200.0], [100.0, 120.0]).expect("a region");
        assert!((region.side - 200.0).abs() < 1e-3, "{region:?}");
        assert!(region.angle.abs() < 1e-6, "{region:?}");
        assert_eq!(region.to_picture([0.0, 1.0]), [0.0, 300.0]);
    }

    #[test]
    fn a_body_lying_to_the_right_turns_its_square() {
        let region = Region::around([100.0, 100.0], [180.0, 100.0]).expect("a region");
        assert!((region.angle - FRAC_PI_2).abs() < 1e-6, "{region:?}");
        // The top of the square, where the head is, is on the right.
        let [x, y] = region.to_picture([0.5, 0.0]);
        assert!((x - 200.0).abs() < 1e-3 && (y - 100.0).abs() < 1e-3);
        let [u, v] = region.to_square([x, y]);
        assert!((u - 0.5).abs() < 1e-5 && v.abs() < 1e-5);
    }

    #[test]
    fn a_box_has_the_axes_of_its_square() {
        // Two points 10 apart along a line at 30° from the picture's rows.
        let (sin, cos) = (PI / 6.0).sin_cos();
        let points = [[5.0, 7.0], [5.0 + 10.0 * cos, 7.0 + 10.0 * sin]];
        let (middle, [wide, high]) = Region::box_around(points.into_iter(), PI / 6.0);
        assert!(
            (wide - 10.0).abs() < 1e-4 && high.abs() < 1e-4,
            "{wide} {high}"
        );
        let expected = [5.0 + 5.0 * cos, 7.0 + 5.0 * sin];
        assert!((0..2).all(|axis| (middle[axis] - expected[axis]).abs() < 1e-4));
    }

    #[test]
    fn what_is_no_place_gives_no_square() {
        assert_eq!(Region::around([f32::NAN, 0.0], [1.0, 9.0]), None);
        assert_eq!(Region::around([1.0, 1.0], [1.0, 1.0]), None);
        assert_eq!(Region::around([1.0, 1.0], [f32::INFINITY, 1.0]), None);
    }

    #[test]
    fn a_square_of_the_picture_itself_is_the_picture() {
        let rgb: Vec<u8> = (0..4 * 4 * 3).map(|at| at * 5).collect();
        let (width, height) = (4, 4);
        let view = View {
            rgb: &rgb,
            width,
            height,
        };
        let mut out = vec![0.0; 48];
        Region::whole(4, 4).cut(view, 4, [0.0, 255.0], Beyond::Black, &mut out);
        let levels: Vec<u8> = out.iter().map(|level| level.round() as u8).collect();
        assert_eq!(levels, rgb);
    }

    #[test]
    fn beyond_the_picture_is_black_or_the_nearest_pixel() {
        let view = View {
            rgb: &[255; 2 * 4 * 3],
            width: 2,
            height: 4,
        };
        let mut out = vec![0.0; 48];
        Region::whole(2, 4).cut(view, 4, [-1.0, 1.0], Beyond::Black, &mut out);
        assert_eq!(out[..9], [-1.0, -1.0, -1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0]);
        Region::whole(2, 4).cut(view, 4, [0.0, 1.0], Beyond::Nearest, &mut out);
        assert!(out.iter().all(|level| *level == 1.0));
    }
}
