//! What the non-rigid field has learned: how far it moves points of canonical space in a pose.

use super::frame::{RenderError, Renderer, read};
use burn::tensor::{Tensor, TensorData};
use yoto_capture::camera::Pose;

impl Renderer {
    /// The non-rigid offsets `[n, 3]`, metres, at the canonical `points` `[n, 3]`, metres, of the
    /// identity in `slot` in `pose`.
    ///
    /// # Errors
    /// When the slot is empty, or the pose is not of its skeleton.
    pub fn displacements(
        &self,
        slot: usize,
        pose: &Pose,
        points: &[[f32; 3]],
    ) -> Result<Vec<[f32; 3]>, RenderError> {
        let body = self.body_in(slot, pose)?;
        let posed = self
            .avatar
            .pose(&self.config, body, slot, pose, self.progress);
        let data = TensorData::new(points.as_flattened().to_vec(), [points.len(), 3]);
        let rest = Tensor::<2>::from_data(data, &self.device());
        let moved = self.avatar.moved(&self.config, &posed, rest);
        let moved = read(moved)?;
        let pairs = moved.as_chunks::<3>().0.iter().zip(points);
        Ok(pairs
            .map(|(moved, point)| std::array::from_fn(|a| moved[a] - point[a]))
            .collect())
    }
}
