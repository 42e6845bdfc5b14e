//! A body of tapered capsules around a skeleton's bones.
//!
//! Joints alone can't tell left from right or one frame from the next: nearly all of them
//! stay inside a mask that is a little wrong. An outline can, though a rough one does, as
//! wrong readings are compared with right ones by the same body.

use crate::skeleton::transform::{Vec3, add, apply, length, scale, sub};
use crate::skeleton::{Pose, Skeleton};

/// Height of the body that the radii below belong to, metres.
const HEIGHT: f64 = 1.7;
/// Radius by words in the name of a bone's lower joint, metres; the first that fits.
const RADII: [(&[&str], f64); 12] = [
    (&["spine", "chest", "torso"], 0.125),
    (&["collar", "clav"], 0.085),
    (&["shoulder", "upperarm"], 0.065),
    (&["elbow", "forearm", "lowerarm"], 0.052),
    (&["wrist"], 0.042),
    (&["hand", "finger", "thumb"], 0.04),
    (&["hip", "upleg", "thigh"], 0.11),
    (&["knee", "leg", "shin", "calf"], 0.085),
    (&["ankle"], 0.058),
    (&["foot", "toe"], 0.045),
    (&["neck"], 0.1),
    (&["head"], 0.06),
];
const HEAD: f64 = 0.095;
/// How far a head, and any other last bone, goes on beyond its joint, metres.
const CROWN: f64 = 0.1;
const TIP: f64 = 0.07;

/// A capsule: ends, metres, and radii at them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Capsule {
    pub ends: [Vec3; 2],
    pub radii: [f64; 2],
}

/// The capsules of a skeleton at rest.
pub(super) struct Figure<'a> {
    skeleton: &'a Skeleton,
    /// With the joint that each rides on.
    capsules: Vec<(usize, Capsule)>,
}

impl<'a> Figure<'a> {
    pub(super) fn of(skeleton: &'a Skeleton) -> Self {
        let size = size(skeleton) / HEIGHT;
        let children = skeleton.children();
        let mut capsules = Vec::new();
        for (joint, &at) in skeleton.rest.iter().enumerate() {
            let radius = radius(&skeleton.names[joint]);
            let Some(parent) = skeleton.parents[joint] else {
                // A bone by itself is a dot, so that even a single joint shows.
                let radius = radius.unwrap_or(0.11) * size;
                let dot = Capsule {
                    ends: [at; 2],
                    radii: [radius; 2],
                };
                capsules.push((joint, dot));
                continue;
            };
            let from = skeleton.rest[parent];
            let bone = length(sub(at, from));
            let radius = radius.map_or((0.2 * bone).clamp(0.03 * size, 0.1 * size), |r| r * size);
            let upper = match skeleton.parents[parent] {
                Some(_) => radius * 1.1,
                None => radius,
            };
            capsules.push((
                parent,
                Capsule {
                    ends: [from, at],
                    radii: [upper, radius],
                },
            ));
            if children[joint].is_empty() && bone > 0.0 {
                let head = skeleton.names[joint].to_lowercase().contains("head");
                let (reach, radius) = if head {
                    (CROWN * size, HEAD * size)
                } else {
                    (TIP * size, radius * 0.9)
                };
                let end = add(at, scale(sub(at, from), reach / bone));
                capsules.push((
                    joint,
                    Capsule {
                        ends: [at, end],
                        radii: [radius; 2],
                    },
                ));
            }
        }
        Self { skeleton, capsules }
    }

    /// The capsules in the world.
    pub(super) fn posed(&self, pose: &Pose) -> Vec<Capsule> {
        let transforms = self.skeleton.world_transforms(pose);
        let placed = self.capsules.iter().map(|(joint, capsule)| Capsule {
            ends: capsule
                .ends
                .map(|end| apply(&transforms[*joint], sub(end, self.skeleton.rest[*joint]))),
            radii: capsule.radii,
        });
        placed.collect()
    }
}

/// The widest extent of the rest joints: span or height, which are nearly the same of a
/// person in a T-pose; metres where the skeleton is in metres.
pub(super) fn size(skeleton: &Skeleton) -> f64 {
    let bounds = skeleton.rest_bounds(0.0);
    (0..3)
        .map(|axis| bounds.max[axis] - bounds.min[axis])
        .fold(0.0, f64::max)
}

fn radius(name: &str) -> Option<f64> {
    let name = name.to_lowercase();
    let fits = |words: &&[&str]| words.iter().any(|word| name.contains(word));
    RADII
        .iter()
        .find(|(words, _)| fits(words))
        .map(|(_, radius)| *radius)
}
