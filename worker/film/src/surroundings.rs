//! What is behind the people of a scene.

use crate::backdrop;
use crate::error::PlanError;
use image::DynamicImage;
use yoto_proto::v1::Scene;

/// A backdrop, or the ground that a shadow falls on.
#[derive(Debug)]
pub struct Surroundings {
    /// The picture behind everybody.
    pub backdrop: Option<DynamicImage>,
    /// The colour where there is no backdrop, linear rgb in [0, 1].
    pub colour: [f32; 3],
}

impl Surroundings {
    /// The surroundings of `scene`; `None` if the `colour` alone is behind everybody.
    ///
    /// # Errors
    /// If the backdrop is no picture, or too large.
    pub(crate) fn new(scene: &Scene, colour: [f32; 3]) -> Result<Option<Self>, PlanError> {
        let backdrop = match scene.backdrop.as_slice() {
            [] => None,
            bytes => Some(
                backdrop::decode(bytes)
                    .map_err(|message| PlanError::invalid("scene.backdrop", message))?,
            ),
        };
        let any = backdrop.is_some() || scene.shadow;
        Ok(any.then_some(Self { backdrop, colour }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_backdrop_that_is_no_picture_is_refused() {
        let scene = |backdrop: &[u8], shadow| Scene {
            backdrop: backdrop.to_vec(),
            shadow,
            ..Scene::default()
        };
        let new = |scene: &Scene| Surroundings::new(scene, [1.0; 3]);
        assert!(new(&scene(&[], false)).is_ok_and(|it| it.is_none()));
        assert!(new(&scene(&[], true)).is_ok_and(|it| it.is_some()));
        let Err(PlanError::Invalid(violations)) = new(&scene(&[1, 2, 3], false)) else {
            panic!("no picture");
        };
        assert_eq!(violations[0].field, "scene.backdrop");
    }
}
