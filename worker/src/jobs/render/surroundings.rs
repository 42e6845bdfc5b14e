//! Draws what is behind and below the people of a scene: a picture and their shadow.

use image::RgbImage;
use image::imageops::{FilterType, crop_imm, resize};
use std::cell::RefCell;
use yoto_avatar::render::Rendered;
use yoto_capture::camera::Camera;
use yoto_capture::skeleton::transform::{add, scale};
use yoto_film::{LIGHT_HEIGHT, Surroundings};

/// Radius of the light's blur on the ground, metres: the sky's light, more than the sun's.
const BLUR: f64 = 0.06;
/// Passes of the blur: three boxes are nearly a bell.
const PASSES: usize = 3;
/// Share of the ground's light that a person stops.
const DARKEST: f32 = 0.5;

/// The surroundings of a scene, ready to be put behind its pictures.
pub(super) struct Background<'a> {
    surroundings: &'a Surroundings,
    transparent: bool,
    /// The backdrop at the size of the last picture: all pictures of a film mostly have one size.
    fitted: RefCell<Option<RgbImage>>,
}

impl<'a> Background<'a> {
    /// `transparent` pictures have the shadow as opacity, and no backdrop.
    pub(super) fn new(surroundings: &'a Surroundings, transparent: bool) -> Self {
        Self {
            surroundings,
            transparent,
            fitted: RefCell::new(None),
        }
    }

    /// Puts the surroundings behind `frame`, which `camera` sees over black.
    pub(super) fn put_behind(
        &self,
        frame: &mut Rendered,
        shadow: Option<&Shadow>,
        camera: &Camera,
    ) {
        let (width, height) = (camera.width, camera.height);
        let mut fitted = self.fitted.borrow_mut();
        if let Some(backdrop) = &self.surroundings.backdrop
            && fitted.as_ref().map(RgbImage::dimensions) != Some((width, height))
        {
            *fitted = Some(filling(backdrop, width, height));
        }
        let pixels = frame.rgb.as_chunks_mut::<3>().0.iter_mut();
        for (index, (rgb, alpha)) in pixels.zip(&mut frame.alpha).enumerate() {
            let (x, y) = (index as u32 % width, index as u32 / width);
            let dark = shadow.map_or(0.0, |shadow| shadow.seen_at(camera, x, y));
            let through = 1.0 - *alpha;
            if self.transparent {
                *alpha += through * dark;
                continue;
            }
            let colour = match fitted.as_ref() {
                Some(picture) => picture.get_pixel(x, y).0.map(|v| f32::from(v) / 255.0),
                None => self.surroundings.colour,
            };
            for (value, behind) in rgb.iter_mut().zip(colour) {
                *value += through * (1.0 - dark) * behind;
            }
        }
    }
}

/// The middle of `picture`, cropped to the aspect ratio of `width` to `height` and scaled to that size. Cropping comes
/// first, unlike in `resize_to_fill`: 8192 x 1 pixels, scaled to cover a square, are 8192 times as many as the
/// square's.
fn filling(picture: &RgbImage, width: u32, height: u32) -> RgbImage {
    let (across, down) = (u64::from(picture.width()), u64::from(picture.height()));
    let aspect = (u64::from(width), u64::from(height));
    // The largest part with that aspect ratio, at least a pixel.
    let wide = (down * aspect.0 / aspect.1).clamp(1, across) as u32;
    let high = (across * aspect.1 / aspect.0).clamp(1, down) as u32;
    let left = (picture.width() - wide) / 2;
    let top = (picture.height() - high) / 2;
    let part = crop_imm(picture, left, top, wide, high);
    resize(&*part, width, height, FilterType::Triangle)
}

/// Shadow on the ground of a scene.
pub(super) struct Shadow {
    above: Camera,
    /// `[H, W]` of the picture from above: shares of the light that does not arrive.
    dark: Vec<f32>,
}

impl Shadow {
    /// The shadow of people whose opacity `[H, W]` the camera `above`, with a square picture, sees.
    pub(super) fn new(above: Camera, opacity: &[f32]) -> Self {
        let pixels_per_metre = above.k[0][0] / LIGHT_HEIGHT;
        let radius = (BLUR * pixels_per_metre).round() as usize;
        let side = above.width as usize;
        let mut dark: Vec<f32> = opacity.iter().map(|value| DARKEST * value).collect();
        for _ in 0..PASSES {
            dark = blurred(&dark, side, radius, 1, side);
            dark = blurred(&dark, side, radius, side, 1);
        }
        Self { above, dark }
    }

    /// Share of light that is missing on the ground that `camera` sees in its pixel `x`, `y`.
    fn seen_at(&self, camera: &Camera, x: u32, y: u32) -> f32 {
        let (from, along) = camera.ray(f64::from(x) + 0.5, f64::from(y) + 0.5);
        let reach = -from[1] / along[1];
        if !reach.is_finite() || reach <= 0.0 {
            return 0.0;
        }
        let ground = add(from, scale(along, reach));
        let Some([u, v]) = self.above.project(ground) else {
            return 0.0;
        };
        let (u, v) = (u - 0.5, v - 0.5);
        let (left, top) = (u.floor(), v.floor());
        let mut sum = 0.0;
        for (column, row) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
            let (column, row) = (left + column, top + row);
            let share = (1.0 - (u - column).abs()) * (1.0 - (v - row).abs());
            let inside = 0.0..f64::from(self.above.width);
            if inside.contains(&column) && inside.contains(&row) {
                let pixel = row as usize * self.above.width as usize + column as usize;
                sum += share as f32 * self.dark[pixel];
            }
        }
        sum
    }
}

/// The means of `values` of `side` rows and columns over up to `radius` neighbours on each side. Neighbours are
/// `step` apart, on lines that begin every `line`.
fn blurred(values: &[f32], side: usize, radius: usize, step: usize, line: usize) -> Vec<f32> {
    let mut means = vec![0.0; values.len()];
    for start in (0..side).map(|it| it * line) {
        for at in 0..side {
            let near = at.saturating_sub(radius)..(at + radius + 1).min(side);
            let sum: f32 = near.map(|it| values[start + it * step]).sum();
            means[start + at * step] = sum / (2 * radius + 1) as f32;
        }
    }
    means
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_avatar::render::SceneView;

    /// Side of the picture from above, pixels.
    const SIDE: u32 = 256;

    fn above() -> Camera {
        let focal = 0.5 * f64::from(SIDE) * LIGHT_HEIGHT / 2.0;
        let up = [0.0, 0.0, -1.0];
        let eye = [1.0, LIGHT_HEIGHT, -1.0];
        Camera::look_at(eye, [1.0, 0.0, -1.0], up, focal, SIDE, SIDE)
    }

    /// A person above the square of 0.5 m around (2, -2).
    fn shadow() -> Shadow {
        let opacity = (0..SIDE * SIDE).map(|at| {
            let metres = |pixel: u32| f64::from(pixel) / 64.0 - 2.0;
            let (x, z) = (metres(at % SIDE), metres(at / SIDE));
            let near = (x - 1.0).abs() < 0.25 && (z + 1.0).abs() < 0.25;
            if near { 1.0 } else { 0.0 }
        });
        let opacity: Vec<f32> = opacity.collect();
        Shadow::new(above(), &opacity)
    }

    #[test]
    fn the_shadow_lies_on_the_ground_below_and_nowhere_else() {
        let shadow = shadow();
        let eye = [4.0, 1.5, 3.0];
        for (point, dark) in [
            ([2.0, 0.0, -2.0], DARKEST),
            ([2.0, 0.0, -1.2], 0.0),
            ([-9.0, 0.0, -9.0], 0.0),
        ] {
            let camera = Camera::look_at(eye, point, [0.0, 1.0, 0.0], 300.0, 64, 64);
            let seen = shadow.seen_at(&camera, 32, 32);
            assert!((seen - dark).abs() < 1e-3, "{point:?}: {seen}");
        }
        // At the edge, half of it.
        let camera = Camera::look_at(eye, [2.25, 0.0, -2.0], [0.0, 1.0, 0.0], 3000.0, 64, 64);
        let seen = shadow.seen_at(&camera, 32, 32);
        assert!((0.2..0.3).contains(&seen), "{seen}");
        // The sky has no shadow.
        let camera = Camera::look_at(eye, [2.0, 3.0, -2.0], [0.0, 1.0, 0.0], 300.0, 64, 64);
        assert_eq!(shadow.seen_at(&camera, 32, 32), 0.0);
    }

    #[test]
    fn the_middle_of_a_backdrop_covers_the_picture() {
        // Columns of their own brightness.
        let wide = RgbImage::from_fn(40, 10, |x, _| image::Rgb([x as u8 * 6; 3]));
        let filled = filling(&wide, 20, 20);
        assert_eq!(filled.dimensions(), (20, 20));
        // The middle ten columns are 15 to 24.
        assert!(filled.get_pixel(0, 0).0[0].abs_diff(15 * 6) <= 2);
        assert!(filled.get_pixel(19, 19).0[0].abs_diff(24 * 6) <= 2);
        for (width, height) in [(8192, 1), (1, 8192)] {
            let line = RgbImage::from_pixel(width, height, image::Rgb([9; 3]));
            let filled = filling(&line, 2048, 2048);
            assert_eq!(filled.dimensions(), (2048, 2048));
            assert_eq!(filled.get_pixel(2047, 2047).0, [9; 3]);
        }
    }

    #[test]
    fn people_stand_before_the_backdrop_and_the_shadow() {
        let shadow = shadow();
        let camera = Camera::look_at(
            [2.0, 2.0, 1.0],
            [2.0, 0.0, -2.0],
            [0.0, 1.0, 0.0],
            40.0,
            3,
            1,
        );
        let backdrop = RgbImage::from_pixel(6, 2, image::Rgb([255, 102, 0]));
        let with_backdrop = Surroundings {
            backdrop: Some(backdrop),
            colour: [1.0; 3],
        };
        let without = Surroundings {
            backdrop: None,
            colour: [1.0; 3],
        };
        // Nobody in the middle, a person on the left, half of a person on the right.
        let frame = || Rendered {
            rgb: vec![0.2, 0.3, 0.4, 0.0, 0.0, 0.0, 0.1, 0.1, 0.1],
            alpha: vec![1.0, 0.0, 0.5],
            ..Rendered::empty(&SceneView {
                actors: Vec::new(),
                camera: camera.clone(),
                background: [0.0; 3],
            })
        };
        let dark = shadow.seen_at(&camera, 1, 0);
        assert!(dark > 0.4, "{dark}");
        let mut seen = frame();
        let background = Background::new(&with_backdrop, false);
        background.put_behind(&mut seen, Some(&shadow), &camera);
        assert_eq!(seen.rgb[0..3], [0.2, 0.3, 0.4]);
        let expected = [1.0 - dark, 0.4 * (1.0 - dark), 0.0];
        assert_eq!(seen.rgb[3..6], expected);
        let mut clear = frame();
        let background = Background::new(&without, true);
        background.put_behind(&mut clear, Some(&shadow), &camera);
        assert_eq!(clear.rgb, frame().rgb);
        assert_eq!(clear.alpha[..2], [1.0, dark]);
    }
}
