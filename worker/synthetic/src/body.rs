//! A body in a pose, as a signed distance field with colours.

use super::build::{Capsule, share_along};
use super::drape::{Drape, Fall, Garment};
use super::outfit::{Colour, Outfit};
use yoto_capture::skeleton::transform::{
    add, apply, compose, inverse, length, normalised, scale, sub,
};
use yoto_capture::skeleton::{Mat34, Pose, Skeleton, Vec3};

/// Capsules closer than this are blended, metres.
pub(crate) const BLEND: f64 = 0.03;
/// Colours of capsules are mixed where their distances differ by less than this, metres.
const COLOUR_BLEND: f64 = 0.012;
/// Farther than this from cloth, a bound of the distance is used instead of the rule, metres.
const FAR: f64 = 0.06;

/// A capsule, moved by its joint.
#[derive(Clone, Debug)]
pub(crate) struct PosedCapsule<'a> {
    pub from: Vec3,
    pub to: Vec3,
    /// Largest distance of the surface from the axis, metres.
    pub thickness: f64,
    /// The vector from `from` to `to`.
    axis: Vec3,
    /// The transformation from the world to the rest pose.
    to_rest: Mat34,
    pub rest: &'a Capsule,
    /// The rule that moves it, and its largest displacement, metres.
    cloth: Option<(Garment, f64)>,
}

impl PosedCapsule<'_> {
    /// Signed distance. It is too large on tapered capsules and stretched cloth, so a ray must step by less.
    pub(crate) fn distance(&self, fall: &Fall<'_>, p: Vec3) -> f64 {
        if self.cloth.is_none() && self.rest.cut.is_none() {
            return self.round_distance(p);
        }
        let reach = self.cloth.map_or(0.0, |(_, reach)| reach);
        let bound = self.round_distance(p) - reach;
        if bound > FAR {
            bound
        } else {
            self.rest.distance(self.looked_up(fall, p))
        }
    }

    fn round_distance(&self, p: Vec3) -> f64 {
        let [first, last] = self.rest.radii;
        let share = share_along(self.from, self.axis, p);
        let off = length(sub(p, add(self.from, scale(self.axis, share))));
        off - (first + (last - first) * share)
    }

    /// The point of the body in the rest pose, with still cloth, that appears at `p`.
    fn looked_up(&self, fall: &Fall<'_>, p: Vec3) -> Vec3 {
        let canonical = apply(&self.to_rest, p);
        match self.cloth {
            Some((garment, _)) => add(canonical, fall.offset(garment, canonical)),
            None => canonical,
        }
    }

    fn colour(&self, fall: &Fall<'_>, outfit: &Outfit, p: Vec3) -> Colour {
        let p = self.looked_up(fall, p);
        let normal = normalised(sub(p, self.rest.centre(p)));
        outfit.colour(self.rest.part, p, normal)
    }
}

/// A person's body in a pose.
pub(crate) struct PosedBody<'a> {
    pub capsules: Vec<PosedCapsule<'a>>,
    outfit: &'a Outfit,
    fall: Fall<'a>,
    /// Largest slope of the estimated distance; the true one's is 1.
    pub stretch: f64,
}

impl<'a> PosedBody<'a> {
    /// The body of `capsules` on `skeleton` in `pose`, in an outfit that `drape` moves.
    pub(crate) fn new(
        skeleton: &Skeleton,
        capsules: &'a [Capsule],
        outfit: &'a Outfit,
        drape: &'a Drape,
        pose: &Pose,
    ) -> Self {
        let fall = drape.posed(pose);
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
                let cloth = rest
                    .part
                    .garment()
                    .map(|garment| (garment, fall.reach(garment)))
                    .filter(|(_, reach)| *reach > 0.0);
                let reach = cloth.map_or(0.0, |(_, reach)| reach);
                PosedCapsule {
                    from,
                    to,
                    thickness: rest.radii[0].max(rest.radii[1]) + reach,
                    axis: sub(to, from),
                    to_rest: inverse(transform),
                    rest,
                    cloth,
                }
            })
            .collect();
        Self {
            capsules,
            outfit,
            stretch: fall.stretch(),
            fall,
        }
    }

    /// Signed distance to the surface of the capsules in `near`.
    pub(crate) fn distance(&self, p: Vec3, near: &[usize]) -> f64 {
        near.iter().fold(f64::INFINITY, |sum, &capsule| {
            let other = self.capsules[capsule].distance(&self.fall, p);
            let overlap = (BLEND - (sum - other).abs()).max(0.0);
            sum.min(other) - overlap * overlap / (4.0 * BLEND)
        })
    }

    /// Whether moving cloth is part of the surface at `p`.
    #[cfg(test)]
    pub(crate) fn on_cloth(&self, p: Vec3, near: &[usize]) -> bool {
        let distance = |index: usize| self.capsules[index].distance(&self.fall, p);
        let nearest = near
            .iter()
            .map(|&i| distance(i))
            .fold(f64::INFINITY, f64::min);
        near.iter().any(|&index| {
            let cloth = self.capsules[index].rest.part.garment().is_some();
            cloth && distance(index) < nearest + BLEND
        })
    }

    /// The colour of the surface at `p`, from the capsules in `near`.
    pub(crate) fn colour(&self, p: Vec3, near: &[usize]) -> Colour {
        let distance = |&capsule: &usize| self.capsules[capsule].distance(&self.fall, p);
        let nearest = near.iter().map(distance).fold(f64::INFINITY, f64::min);
        let mut sum = [0.0; 3];
        let mut total = 0.0;
        for index in near {
            let weight = 1.0 - (distance(index) - nearest) / COLOUR_BLEND;
            if weight > 0.0 {
                let weight = weight * weight;
                let colour = self.capsules[*index].colour(&self.fall, self.outfit, p);
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
