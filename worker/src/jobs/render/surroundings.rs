//! What is behind and below the people of a scene: a picture and their shadow.

use super::models::Troupe;
use crate::jobs::JobFailure;
use image::{DynamicImage, RgbImage, imageops::FilterType};
use std::cell::RefCell;
use yoto_avatar::render::{Rendered, SceneView};
use yoto_capture::{
    camera::Camera,
    skeleton::transform::{Vec3, add, scale},
};
use yoto_proto::v1::Scene;

/// Height of the light that casts the shadow, metres: shadows of heads are at most 2 % larger than those of
/// feet.
const LIGHT_HEIGHT: f64 = 100.0;
/// Side of the picture of the shadow, pixels.
const SHADOW_SIDE: u32 = 256;
/// What people reach beyond their joints, metres.
const REACH: f64 = 0.35;
/// Radius of the light's blur on the ground, metres: the sky's light, more than the sun's.
const BLUR: f64 = 0.06;
/// Passes of the blur: three boxes are nearly a bell.
const PASSES: usize = 3;
/// Share of the ground's light that a person stops.
const DARKEST: f32 = 0.5;

/// What is behind and below people.
pub(super) struct Surroundings {
    backdrop: Option<DynamicImage>,
    /// The backdrop at the size of the last picture: all pictures of a film mostly have one size.
    fitted: RefCell<Option<RgbImage>>,
    colour: [f32; 3],
    shadow: bool,
    transparent: bool,
}

impl Surroundings {
    /// What `scene` has, or `colour` behind everybody; `None` for the colour alone.
    ///
    /// # Errors
    /// If the backdrop is no picture.
    pub(super) fn new(
        scene: &Scene,
        colour: [f32; 3],
        transparent: bool,
    ) -> Result<Option<Self>, JobFailure> {
        let backdrop = match scene.backdrop.as_slice() {
            [] => None,
            bytes => Some(image::load_from_memory(bytes).map_err(|error| {
                JobFailure::invalid("render", "scene.backdrop", error.to_string())
            })?),
        };
        let any = backdrop.is_some() || scene.shadow;
        Ok(any.then_some(Self {
            backdrop,
            fitted: RefCell::new(None),
            colour,
            shadow: scene.shadow,
            transparent,
        }))
    }

    /// Puts them behind `frame`, which `camera` sees over black.
    pub(super) fn behind(&self, frame: &mut Rendered, shadow: Option<&Shadow>, camera: &Camera) {
        let (width, height) = (camera.width, camera.height);
        let mut fitted = self.fitted.borrow_mut();
        if let Some(backdrop) = &self.backdrop
            && fitted.as_ref().map(RgbImage::dimensions) != Some((width, height))
        {
            let filled = backdrop.resize_to_fill(width, height, FilterType::Triangle);
            *fitted = Some(filled.to_rgb8());
        }
        let pixels = frame.rgb.as_chunks_mut::<3>().0.iter_mut();
        for (at, (rgb, alpha)) in pixels.zip(&mut frame.alpha).enumerate() {
            let (x, y) = (at as u32 % width, at as u32 / width);
            let dark = shadow.map_or(0.0, |shadow| shadow.seen_at(camera, x, y));
            let through = 1.0 - *alpha;
            if self.transparent {
                *alpha += through * dark;
                continue;
            }
            let colour = match fitted.as_ref() {
                Some(picture) => picture.get_pixel(x, y).0.map(|v| f32::from(v) / 255.0),
                None => self.colour,
            };
            for (value, behind) in rgb.iter_mut().zip(colour) {
                *value += through * (1.0 - dark) * behind;
            }
        }
    }

    /// The shadow of the people of `view`, if it is wanted and anybody is there. It is what `draw` sees of
    /// them from above.
    ///
    /// # Errors
    /// Those of `draw`.
    pub(super) fn shadow(
        &self,
        troupe: Troupe<'_>,
        view: &SceneView,
        draw: impl FnOnce(&SceneView) -> Result<Rendered, JobFailure>,
    ) -> Result<Option<Shadow>, JobFailure> {
        let Some(camera) = self.shadow.then(|| from_above(troupe, view)).flatten() else {
            return Ok(None);
        };
        let drawn = draw(&SceneView {
            actors: view.actors.clone(),
            camera: camera.clone(),
            background: [0.0; 3],
        })?;
        Ok(Some(Shadow::new(camera, drawn.alpha)))
    }
}

/// A camera above the people of `view` that sees all of them.
fn from_above(troupe: Troupe<'_>, view: &SceneView) -> Option<Camera> {
    let joints = troupe.joints(view);
    let sum = joints.iter().fold([0.0; 3], |sum, joint| add(sum, *joint));
    let [x, _, z] = scale(sum, 1.0 / joints.len().max(1) as f64);
    let far = |joint: &Vec3| (joint[0] - x).abs().max((joint[2] - z).abs());
    let widest = joints.iter().map(far).reduce(f64::max)? + REACH;
    let focal = 0.5 * f64::from(SHADOW_SIDE) * LIGHT_HEIGHT / widest;
    let (eye, ground) = ([x, LIGHT_HEIGHT, z], [x, 0.0, z]);
    let side = SHADOW_SIDE;
    Some(Camera::look_at(
        eye,
        ground,
        [0.0, 0.0, -1.0],
        focal,
        side,
        side,
    ))
}

/// Shadow on the ground of a scene.
pub(super) struct Shadow {
    above: Camera,
    /// `[SHADOW_SIDE, SHADOW_SIDE]`, shares of the light that does not arrive.
    dark: Vec<f32>,
}

impl Shadow {
    /// The shadow of people of whom the camera `above` sees `opacity`.
    fn new(above: Camera, opacity: Vec<f32>) -> Self {
        let pixels_per_metre = above.k[0][0] / LIGHT_HEIGHT;
        let radius = (BLUR * pixels_per_metre).round() as usize;
        let side = SHADOW_SIDE as usize;
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
            let inside = 0.0..f64::from(SHADOW_SIDE);
            if inside.contains(&column) && inside.contains(&row) {
                let at = row as usize * SHADOW_SIDE as usize + column as usize;
                sum += share as f32 * self.dark[at];
            }
        }
        sum
    }
}

/// `values` of `side` rows and columns, each the mean of those up to `radius` steps of `step` away, along lines
/// that begin every `line`.
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

    fn above() -> Camera {
        let focal = 0.5 * f64::from(SHADOW_SIDE) * LIGHT_HEIGHT / 2.0;
        let up = [0.0, 0.0, -1.0];
        let eye = [1.0, LIGHT_HEIGHT, -1.0];
        Camera::look_at(eye, [1.0, 0.0, -1.0], up, focal, SHADOW_SIDE, SHADOW_SIDE)
    }

    /// Somebody above the square of 0.5 m around the place (2, -2).
    fn shadow() -> Shadow {
        let opacity = (0..SHADOW_SIDE * SHADOW_SIDE).map(|at| {
            let metres = |pixel: u32| f64::from(pixel) / 64.0 - 2.0;
            let (x, z) = (metres(at % SHADOW_SIDE), metres(at / SHADOW_SIDE));
            let near = (x - 1.0).abs() < 0.25 && (z + 1.0).abs() < 0.25;
            if near { 1.0 } else { 0.0 }
        });
        Shadow::new(above(), opacity.collect())
    }

    #[test]
    fn the_shadow_lies_on_the_ground_below_and_nowhere_else() {
        let shadow = shadow();
        let eye = [4.0, 1.5, 3.0];
        for (place, dark) in [
            ([2.0, 0.0, -2.0], DARKEST),
            ([2.0, 0.0, -1.2], 0.0),
            ([-9.0, 0.0, -9.0], 0.0),
        ] {
            let camera = Camera::look_at(eye, place, [0.0, 1.0, 0.0], 300.0, 64, 64);
            let seen = shadow.seen_at(&camera, 32, 32);
            assert!((seen - dark).abs() < 1e-3, "{place:?}: {seen}");
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
        let mut png = std::io::Cursor::new(Vec::new());
        let backdrop = RgbImage::from_pixel(6, 2, image::Rgb([255, 102, 0]));
        backdrop
            .write_to(&mut png, image::ImageFormat::Png)
            .expect("encodes");
        let scene = |backdrop: Vec<u8>| Scene {
            backdrop,
            shadow: true,
            ..Scene::default()
        };
        // In the middle nobody, on the left somebody, on the right half of somebody.
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
        let new = |scene: &Scene, transparent| {
            let found = Surroundings::new(scene, [1.0; 3], transparent);
            found.expect("a picture").expect("something")
        };
        let mut seen = frame();
        let behind = new(&scene(png.into_inner()), false);
        behind.behind(&mut seen, Some(&shadow), &camera);
        assert_eq!(seen.rgb[0..3], [0.2, 0.3, 0.4]);
        let expected = [1.0 - dark, 0.4 * (1.0 - dark), 0.0];
        assert_eq!(seen.rgb[3..6], expected);
        let mut clear = frame();
        new(&scene(Vec::new()), true).behind(&mut clear, Some(&shadow), &camera);
        assert_eq!(clear.rgb, frame().rgb);
        assert_eq!(clear.alpha[..2], [1.0, dark]);
        assert!(Surroundings::new(&Scene::default(), [1.0; 3], false).is_ok_and(|it| it.is_none()));
        let Err(JobFailure::Invalid(found)) =
            Surroundings::new(&scene(vec![1, 2, 3]), [0.0; 3], false)
        else {
            panic!("no picture");
        };
        assert_eq!(found[0].field, "scene.backdrop");
    }
}
