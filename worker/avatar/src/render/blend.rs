//! Rendering somebody between two identities of a model.

use super::frame::{RenderError, Renderer};
use crate::config::Variant;
use crate::identity::blend::Blend;
use crate::motion::body::Body;

impl Renderer {
    /// Adds an identity between those in the slots `from` and `to`, and returns the model and the
    /// new slot. Identity code, motion weights, tables and rest joints are interpolated linearly:
    /// `share` 0 gives `from`, 1 gives `to`.
    ///
    /// # Errors
    /// If a slot is empty, `share` is not between 0 and 1, or the model consists of splats.
    pub fn with_blend(
        mut self,
        from: usize,
        to: usize,
        share: f32,
    ) -> Result<(Self, usize), RenderError> {
        if !(0.0..=1.0).contains(&share) {
            return Err(RenderError::Settings(format!(
                "share: {share} is not between 0 and 1"
            )));
        }
        if self.config.splats.is_some() {
            return Err(RenderError::Settings(
                "there is nobody between two people of splats: their splats do not correspond"
                    .into(),
            ));
        }
        let skeleton = |slot| self.skeleton(slot).ok_or(RenderError::NoSuchSlot(slot));
        let (first, second) = (skeleton(from)?, skeleton(to)?);
        let mut mixed = first.clone();
        for (joint, other) in mixed.rest.iter_mut().zip(&second.rest) {
            for (a, b) in joint.iter_mut().zip(other) {
                *a += f64::from(share) * (b - *a);
            }
        }
        // Without identities, all people share the same parameters.
        if self.config.variant != Variant::NoIdentity {
            self.avatar.append(&Blend { from, to, share });
        }
        let body = Body::new(mixed, &self.config, &self.device());
        Ok(self.with_body(body))
    }
}
