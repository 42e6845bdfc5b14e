//! A body in a pose, as a signed distance field with colours.

use super::build::Capsule;
use super::outfit::{Colour, Outfit};
use crate::camera::Pose;
use crate::skeleton::transform::{
    add, apply, compose, dot, inverse, length, normalised, scale, sub,
};
use crate::skeleton::{Mat34, Skeleton, Vec3};

/// Capsules closer than this flow into each other, metres.
pub(super) const BLEND: f64 = 0.03;
/// Colours of capsules mix where they are equally near, up to this difference, metres.
const COLOUR_BLEND: f64 = 0.012;

/// A capsule where its joint has put it.
#[derive(Clone, Debug)]
pub(super) struct PosedCapsule<'a> {
    pub from: Vec3,
    pub to: Vec3,
    pub radii: [f64; 2],
    /// From `from` to `to`.
    axis: Vec3,
    /// One by its squared length; 0 for a sphere.
    per_squared: f64,
    /// From the world back to the unposed body.
    to_rest: Mat34,
    rest: &'a Capsule,
}

impl PosedCapsule<'_> {
    /// Signed distance, a little too large on slopes: step by less than all of it.
    pub fn distance(&self, p: Vec3) -> f64 {
        let from = sub(p, self.from);
        let share = (dot(from, self.axis) * self.per_squared).clamp(0.0, 1.0);
        let off = length(sub(from, scale(self.axis, share)));
        off - (self.radii[0] + (self.radii[1] - self.radii[0]) * share)
    }

    fn colour(&self, outfit: &Outfit, p: Vec3) -> Colour {
        let p = apply(&self.to_rest, p);
        let axis = sub(self.rest.to, self.rest.from);
        let share = (dot(sub(p, self.rest.from), axis) * self.per_squared).clamp(0.0, 1.0);
        let centre = add(self.rest.from, scale(axis, share));
        outfit.colour(self.rest.part, p, normalised(sub(p, centre)))
    }
}

/// All capsules of a person in a pose.
pub(super) struct PosedBody<'a> {
    pub capsules: Vec<PosedCapsule<'a>>,
    outfit: &'a Outfit,
}

impl<'a> PosedBody<'a> {
    pub fn new(
        skeleton: &Skeleton,
        capsules: &'a [Capsule],
        outfit: &'a Outfit,
        pose: &Pose,
    ) -> Self {
        let at_rest = skeleton.world_transforms(&Pose::rest(skeleton.joints()));
        let transforms: Vec<Mat34> = skeleton
            .world_transforms(pose)
            .iter()
            .zip(&at_rest)
            .map(|(posed, rest)| compose(posed, &inverse(rest)))
            .collect();
        let capsules = capsules
            .iter()
            .map(|rest| {
                let transform = &transforms[rest.joint];
                let (from, to) = (apply(transform, rest.from), apply(transform, rest.to));
                let axis = sub(to, from);
                let squared = dot(axis, axis);
                PosedCapsule {
                    from,
                    to,
                    axis,
                    per_squared: if squared > 0.0 { 1.0 / squared } else { 0.0 },
                    radii: rest.radii,
                    to_rest: inverse(transform),
                    rest,
                }
            })
            .collect();
        Self { capsules, outfit }
    }

    /// Signed distance to the surface, counting the capsules in `near` alone.
    pub fn distance(&self, p: Vec3, near: &[usize]) -> f64 {
        near.iter().fold(f64::INFINITY, |sum, &capsule| {
            let other = self.capsules[capsule].distance(p);
            let overlap = (BLEND - (sum - other).abs()).max(0.0);
            sum.min(other) - overlap * overlap / (4.0 * BLEND)
        })
    }

    /// The colour of the surface at `p`, from the capsules in `near`.
    pub fn colour(&self, p: Vec3, near: &[usize]) -> Colour {
        let distance = |&capsule: &usize| self.capsules[capsule].distance(p);
        let nearest = near.iter().map(distance).fold(f64::INFINITY, f64::min);
        let mut sum = [0.0; 3];
        let mut total = 0.0;
        for index in near {
            let weight = 1.0 - (distance(index) - nearest) / COLOUR_BLEND;
            if weight > 0.0 {
                let weight = weight * weight;
                let colour = self.capsules[*index].colour(self.outfit, p);
                sum = add(sum, scale(colour, weight));
                total += weight;
            }
        }
        if total > 0.0 {
            sum.map(|v| (v / total).clamp(0.0, 1.0))
        } else {
            sum
        }
    }
}
