//! The rest positions of observed points by a model: what its skinning and its non-rigid
//! field have learned together.

use super::frame::{RenderError, Renderer};
use crate::host::read;
use burn::tensor::{Tensor, TensorData};
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::transform::{apply, inverse};

/// The rest points of observed ones, `[n, 3]`, metres.
#[derive(Debug, Clone, PartialEq)]
pub struct RestPoints {
    /// The points after inverse skinning alone.
    pub skinned: Vec<[f32; 3]>,
    /// The points after the non-rigid field: where the appearance is looked up.
    pub moved: Vec<[f32; 3]>,
}

impl Renderer {
    /// The rest positions, by the identity in `slot`, of the `observed` points `[n, 3]`, metres, of the world in
    /// `pose`.
    ///
    /// # Errors
    /// When the slot is empty, or the pose is not of its skeleton.
    pub fn rest_points(
        &self,
        slot: usize,
        pose: &Pose,
        observed: &[[f32; 3]],
    ) -> Result<RestPoints, RenderError> {
        let body = self.body_in(slot, pose)?;
        let posed = self
            .avatar
            .pose(&self.config, body, slot, pose, self.schedule_progress);
        let n = observed.len();
        let to_body = inverse(&body.skeleton.body_to_world(pose));
        let in_body: Vec<f32> = observed
            .iter()
            .flat_map(|point| apply(&to_body, point.map(f64::from)))
            .map(|v| v as f32)
            .collect();
        let data = TensorData::new(in_body, [n, 3]);
        let points = Tensor::<2>::from_data(data, &self.device());
        let (skinned, _) = self.avatar.unpose(&self.config, body, &posed, points, None);
        let moved = self
            .avatar
            .apply_non_rigid(&self.config, &posed, skinned.clone());
        let [skinned, moved] = [read(skinned)?, read(moved)?];
        Ok(RestPoints {
            skinned: skinned.as_chunks::<3>().0.to_vec(),
            moved: moved.as_chunks::<3>().0.to_vec(),
        })
    }
}
