//! The positions of a person's splats in a pose: a splat is a material point, which can be followed.

use super::frame::{RenderError, Renderer};
use crate::avatar::AvatarAppearance;
use crate::field::splats::HIDDEN;
use crate::host::read;
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::transform::apply;
use yoto_ops::warp::inverse::solve;

/// Positions of splats, `[N, 3]`, metres, of the world in a pose.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackedSplats {
    /// Positions after skinning alone.
    pub skinned: Vec<[f32; 3]>,
    /// Positions after pose blend shapes and skinning.
    pub moved: Vec<[f32; 3]>,
}

impl Renderer {
    /// The positions in `pose` of the splats of the identity in `slot` that are drawn; `None` if the model has a field.
    ///
    /// # Errors
    /// When the slot is empty, or the pose is not of its skeleton.
    pub fn track_splats(
        &self,
        slot: usize,
        pose: &Pose,
    ) -> Result<Option<TrackedSplats>, RenderError> {
        let body = self.body_in(slot, pose)?;
        let posed = (self.avatar).pose(&self.config, body, slot, pose, self.schedule_progress);
        let avatar = match self.avatar.appearance(&self.config) {
            AvatarAppearance::Splats(avatar) => avatar,
            AvatarAppearance::Field(_) => return Ok(None),
        };
        let splats = avatar.posed_splats(body, &posed)?;
        let opacities = read(splats.opacities.detach())?;
        let transforms = read(splats.transforms.detach())?;
        let moved = read(splats.means.detach())?;
        let still = read(avatar.splats[posed.slot()].means.val().detach())?;
        let to_world = body.skeleton.body_to_world(pose);
        let carried = |means: &[f32]| -> Vec<[f32; 3]> {
            let rows = transforms.as_chunks::<12>().0.iter();
            let all = rows.zip(means.as_chunks::<3>().0).zip(&opacities);
            let shown = all.filter(|(_, opacity)| **opacity != HIDDEN);
            let place = |((transform, mean), _): ((&[f32; 12], &[f32; 3]), _)| {
                let in_body = solve::apply(transform, *mean).map(f64::from);
                apply(&to_world, in_body).map(|v| v as f32)
            };
            shown.map(place).collect()
        };
        Ok(Some(TrackedSplats {
            skinned: carried(&still),
            moved: carried(&moved),
        }))
    }
}
