//! One frame of a picture sheet: image, mask's outline, skeleton, box.

use super::canvas::{Colour, disc, dot, line};
use super::text;
use image::{Rgb, RgbImage};
use yoto_capture::FrameImage;
use yoto_capture::check::Drawing;

/// Side of a tile's picture, pixels.
pub(super) const SIDE: u32 = 256;
/// Room for the caption below it.
pub(super) const CAPTION: u32 = 14;

pub(super) const LEFT: Colour = Rgb([90, 220, 90]);
pub(super) const RIGHT: Colour = Rgb([250, 110, 90]);
pub(super) const MIDDLE: Colour = Rgb([250, 220, 80]);
pub(super) const OUTLINE: Colour = Rgb([80, 220, 255]);
pub(super) const BOX: Colour = Rgb([170, 140, 255]);
pub(super) const OUTSIDE: Colour = Rgb([255, 40, 220]);
const INK: Colour = Rgb([220, 220, 225]);
const PAPER: Colour = Rgb([38, 38, 44]);

/// The part of an image that a tile shows.
#[derive(Clone, Copy, Debug)]
struct Window {
    x: f64,
    y: f64,
    side: f64,
}

impl Window {
    /// A square around the mask and the joints near it, or the whole image if they are far apart,
    /// to show both.
    fn of(frame: &FrameImage, drawing: &Drawing) -> Self {
        let (width, height) = (frame.width as f64, frame.height as f64);
        let whole = Self {
            x: (width - width.max(height)) / 2.0,
            y: (height - width.max(height)) / 2.0,
            side: width.max(height),
        };
        let mut low = [f64::INFINITY; 2];
        let mut high = [f64::NEG_INFINITY; 2];
        let mut include = |point: [f64; 2]| {
            for axis in 0..2 {
                low[axis] = low[axis].min(point[axis]);
                high[axis] = high[axis].max(point[axis]);
            }
        };
        for (i, _) in frame.mask.iter().enumerate().filter(|(_, m)| **m >= 128) {
            include([(i % frame.width) as f64, (i / frame.width) as f64]);
        }
        let joints = drawing.joints.iter();
        for joint in joints {
            match joint {
                Some([u, v]) if (0.0..width).contains(u) && (0.0..height).contains(v) => {
                    include([*u, *v]);
                }
                _ => return whole,
            }
        }
        let side = 1.25 * (high[0] - low[0]).max(high[1] - low[1]);
        if !side.is_finite() || side < 8.0 || side >= whole.side {
            return whole;
        }
        Self {
            x: (low[0] + high[0] - side) / 2.0,
            y: (low[1] + high[1] - side) / 2.0,
            side,
        }
    }

    fn to_tile(self, [u, v]: [f64; 2]) -> [f64; 2] {
        let scale = f64::from(SIDE) / self.side;
        [(u - self.x) * scale, (v - self.y) * scale]
    }
}

/// The tile of a frame.
pub(super) fn tile(frame: &FrameImage, drawing: &Drawing, index: u32) -> RgbImage {
    let window = Window::of(frame, drawing);
    let mut picture = RgbImage::from_pixel(SIDE, SIDE, PAPER);
    let step = window.side / f64::from(SIDE);
    let source = |x: u32, y: u32| {
        let column = (window.x + (f64::from(x) + 0.5) * step).floor();
        let row = (window.y + (f64::from(y) + 0.5) * step).floor();
        let inside =
            column >= 0.0 && row >= 0.0 && column < frame.width as f64 && row < frame.height as f64;
        inside.then(|| row as usize * frame.width + column as usize)
    };
    let covered = |x: u32, y: u32| source(x, y).is_some_and(|at| frame.mask[at] >= 128);
    for y in 0..SIDE {
        for x in 0..SIDE {
            let Some(at) = source(x, y) else { continue };
            // Brightened, so that dark clothes are visible on black.
            let lift = |value: u8| (40 + u32::from(value) * 200 / 255) as u8;
            let pixel = [0, 1, 2].map(|c| lift(frame.rgb[3 * at + c]));
            picture.put_pixel(x, y, Rgb(pixel));
            let here = covered(x, y);
            let edge = here
                && ((x > 0 && !covered(x - 1, y))
                    || (y > 0 && !covered(x, y - 1))
                    || !covered(x + 1, y)
                    || !covered(x, y + 1));
            if edge {
                picture.put_pixel(x, y, OUTLINE);
            }
        }
    }
    skeleton(&mut picture, frame, drawing, &window);
    let inside = drawing
        .joints
        .iter()
        .filter(|j| in_mask(frame, **j))
        .count();
    let caption = format!("frame {index}: {inside}/{} joints in", drawing.joints.len());
    let mut tile = RgbImage::from_pixel(SIDE, SIDE + CAPTION, PAPER);
    for (x, y, pixel) in picture.enumerate_pixels() {
        dot(&mut tile, i64::from(x), i64::from(y), *pixel);
    }
    text::write(&mut tile, 4, SIDE + 3, 1, INK, &caption);
    tile
}

fn in_mask(frame: &FrameImage, joint: Option<[f64; 2]>) -> bool {
    let Some([u, v]) = joint else { return false };
    let inside = u >= 0.0 && v >= 0.0 && u < frame.width as f64 && v < frame.height as f64;
    inside && frame.mask[v as usize * frame.width + u as usize] >= 64
}

fn skeleton(picture: &mut RgbImage, frame: &FrameImage, drawing: &Drawing, window: &Window) {
    for corner in 0..8usize {
        for axis in 0..3 {
            let other = corner | (1 << axis);
            if other == corner {
                continue;
            }
            if let (Some(a), Some(b)) = (drawing.corners[corner], drawing.corners[other]) {
                line(picture, window.to_tile(a), window.to_tile(b), 1.0, BOX);
            }
        }
    }
    let projected = |joint: usize| {
        let point = *drawing.joints.get(joint)?;
        point.map(|point| window.to_tile(point))
    };
    for &[parent, child] in &drawing.bones {
        let colour = match drawing.sides.get(child) {
            Some(side) if *side > 0.02 => LEFT,
            Some(side) if *side < -0.02 => RIGHT,
            _ => MIDDLE,
        };
        if let (Some(a), Some(b)) = (projected(parent), projected(child)) {
            line(picture, a, b, 2.0, colour);
        }
    }
    for (joint, point) in drawing.joints.iter().enumerate() {
        if let Some(at) = projected(joint) {
            let inside = in_mask(frame, *point);
            let (radius, colour) = if inside { (1.5, INK) } else { (3.0, OUTSIDE) };
            disc(picture, at, radius, colour);
        }
    }
}
