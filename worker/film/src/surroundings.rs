//! What is behind the people of a scene.

use image::RgbImage;
use yoto_proto::v1::Scene;

/// A backdrop, or the ground that a shadow falls on.
#[derive(Debug)]
pub struct Surroundings {
    /// The picture behind everybody. A plan has none: its caller decodes it, within limits.
    pub backdrop: Option<RgbImage>,
    /// The colour where there is no backdrop, linear rgb in [0, 1].
    pub colour: [f32; 3],
}

impl Surroundings {
    /// The surroundings of `scene`, still without its backdrop; `None` if the `colour` alone is behind everybody.
    pub(crate) fn new(scene: &Scene, colour: [f32; 3]) -> Option<Self> {
        let any = !scene.backdrop.is_empty() || scene.shadow;
        any.then_some(Self {
            backdrop: None,
            colour,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_with_a_backdrop_or_a_shadow_has_surroundings() {
        let new = |backdrop: &[u8], shadow| {
            let scene = Scene {
                backdrop: backdrop.to_vec(),
                shadow,
                ..Scene::default()
            };
            Surroundings::new(&scene, [1.0; 3])
        };
        assert!(new(&[], false).is_none());
        assert!(new(&[], true).is_some_and(|it| it.colour == [1.0; 3]));
        assert!(new(&[1], false).is_some());
    }
}
