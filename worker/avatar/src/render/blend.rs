//! Rendering somebody between two identities of a model, and one person on another's bones.

use super::frame::{RenderError, Renderer};
use crate::config::Variant;
use crate::identity::blend::Blend;
use crate::motion::body::CanonicalBody;
use yoto_capture::skeleton::Skeleton;
use yoto_capture::skeleton::parts::with_joints_of;

impl Renderer {
    /// Adds somebody between the identities in the slots `from` and `to`, and returns the model and the
    /// new slots, all of which belong into the picture. `share` 0 gives `from`, 1 gives `to`.
    ///
    /// In models with a field, there is one: identity code, motion weights, tables and rest joints are
    /// interpolated linearly. Of splats, both people are added, on the interpolated bones, each with an opacity equal to
    /// their share, once their outlines and colours are those in between (`render/morph.rs`).
    ///
    /// # Errors
    /// If a slot is empty, or `share` is not between 0 and 1.
    pub fn with_blend(
        self,
        from: usize,
        to: usize,
        share: f32,
    ) -> Result<(Self, Vec<usize>), RenderError> {
        if !(0.0..=1.0).contains(&share) {
            return Err(RenderError::Settings(format!(
                "share: {share} is not between 0 and 1"
            )));
        }
        let bones = self.bones_between(from, to, share)?;
        let capabilities = self.config.appearance.capabilities();
        // Without identities there is one person's worth of parameters, for everybody.
        if capabilities.interpolated_parameters || self.config.variant == Variant::NoIdentity {
            let body = CanonicalBody::new(bones, &self.config, &self.device());
            let (renderer, slot) = self.with_person(Blend { from, to, share }, body);
            return Ok((renderer, vec![slot]));
        }
        let (mut renderer, mut slots) = (self, Vec::new());
        let parts = [(from, 1.0 - share), (to, share)];
        for (slot, _) in parts.iter().filter(|(_, part)| *part > 0.0) {
            let (grown, new) = renderer.with_bones(*slot, &bones)?;
            renderer = grown;
            slots.push(new);
        }
        // All of one of them is that person, bit for bit.
        if let [first, second] = slots[..] {
            renderer.morph([first, second], share)?;
            for (slot, (_, part)) in slots.iter().zip(parts) {
                renderer.avatar.fade(*slot, part);
            }
        }
        Ok((renderer, slots))
    }

    /// Adds the identity in `slot` on other `bones`: as long and as far apart as those of somebody else, and
    /// with what this person has around theirs. Returns the model and the new slot.
    ///
    /// # Errors
    /// If the slot is empty, or the skeletons have different numbers of joints.
    pub fn with_bones(self, slot: usize, bones: &Skeleton) -> Result<(Self, usize), RenderError> {
        let own = self.skeleton(slot).ok_or_else(|| self.absence(slot))?;
        let bones = with_joints_of(bones, own);
        if own.joints() != bones.joints() {
            return Err(RenderError::Settings(format!(
                "bones: {} joints, the person has {}",
                bones.joints(),
                own.joints()
            )));
        }
        let body = CanonicalBody::new(own.clone(), &self.config, &self.device());
        let itself = Blend {
            from: slot,
            to: slot,
            share: 0.0,
        };
        Ok(self.with_person(itself, body.on_bones_of(bones)))
    }

    /// The bones between those of two people.
    fn bones_between(&self, from: usize, to: usize, share: f32) -> Result<Skeleton, RenderError> {
        let skeleton = |slot| self.skeleton(slot).ok_or_else(|| self.absence(slot));
        let (first, second) = (skeleton(from)?, skeleton(to)?);
        let mut mixed = first.clone();
        let second = with_joints_of(second, first);
        for (joint, other) in mixed.rest.iter_mut().zip(&second.rest) {
            for (a, b) in joint.iter_mut().zip(other) {
                *a += f64::from(share) * (b - *a);
            }
        }
        Ok(mixed)
    }

    /// Adds the mixture `blend` in `body`.
    fn with_person(mut self, blend: Blend, body: CanonicalBody) -> (Self, usize) {
        // Without identities, all people share the same parameters.
        if self.config.variant != Variant::NoIdentity {
            self.avatar.append(&blend);
        }
        self.with_body(body)
    }
}
