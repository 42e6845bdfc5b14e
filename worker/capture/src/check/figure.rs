//! A body of tapered capsules around a skeleton's bones.
//!
//! Joints alone can't tell left from right or one frame from the next: nearly all of them stay inside a
//! mask that is a little wrong. An outline can. A rough one is enough, since wrong and right readings are
//! compared by the same body.

use crate::skeleton::transform::{Vec3, add, apply, length, scale, sub};
use crate::skeleton::{Pose, Skeleton};

/// Height of the body to which the radii below belong, metres.
const HEIGHT: f64 = 1.7;
/// Radius of a bone by words in the name of its lower joint, metres. The first match counts.
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
/// Length of a head, and of any other last bone, beyond its joint, metres.
const CROWN: f64 = 0.1;
const TIP: f64 = 0.07;

/// A tapered capsule: its ends, and its radii at the ends, metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Capsule {
    pub ends: [Vec3; 2],
    pub radii: [f64; 2],
}

/// The capsules of a skeleton at rest.
pub(super) struct CapsuleBody<'a> {
    skeleton: &'a Skeleton,
    /// Each capsule with the joint that moves it.
    capsules: Vec<(usize, Capsule)>,
}

impl<'a> CapsuleBody<'a> {
    pub(super) fn of(skeleton: &'a Skeleton) -> Self {
        let size = size(skeleton) / HEIGHT;
        let children = skeleton.children();
        let mut capsules = Vec::new();
        for (joint, &at) in skeleton.rest.iter().enumerate() {
            let radius = radius(&skeleton.names[joint]);
            let Some(parent) = skeleton.parents[joint] else {
                // A root without bones is drawn as a dot, so that even a single joint is visible.
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

    /// The region of the body of each capsule.
    pub(super) fn regions(&self) -> Vec<Region> {
        let bounds = self.skeleton.rest_bounds(0.0);
        let middle = 0.5 * (bounds.min[0] + bounds.max[0]);
        let height = (bounds.max[1] - bounds.min[1]).max(1e-9);
        let widest = size(self.skeleton).max(1e-9);
        let capsules = self.capsules.iter();
        capsules
            .map(|(_, capsule)| {
                let [x, y, _] = scale(add(capsule.ends[0], capsule.ends[1]), 0.5);
                Region::at((y - bounds.min[1]) / height, (x - middle).abs() / widest)
            })
            .collect()
    }

    /// The direction of the body's front (z at rest) at each capsule, in the world.
    pub(super) fn fronts(&self, pose: &Pose) -> Vec<Vec3> {
        let transforms = self.skeleton.world_transforms(pose);
        let capsules = self.capsules.iter();
        capsules
            .map(|(joint, _)| transforms[*joint].map(|row| row[2]))
            .collect()
    }

    /// The capsules in the world.
    pub(super) fn posed(&self, pose: &Pose) -> Vec<Capsule> {
        let transforms = self.skeleton.world_transforms(pose);
        let posed = self.capsules.iter().map(|(joint, capsule)| Capsule {
            ends: capsule
                .ends
                .map(|end| apply(&transforms[*joint], sub(end, self.skeleton.rest[*joint]))),
            radii: capsule.radii,
        });
        posed.collect()
    }
}

/// A region of the body with a thickness of its own: clothes and hair change one region and not the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Region {
    Head,
    Chest,
    Hips,
    Thighs,
    Shins,
    Feet,
    UpperArms,
    Forearms,
}

impl Region {
    pub(super) const ALL: [Self; 8] = [
        Self::Head,
        Self::Chest,
        Self::Hips,
        Self::Thighs,
        Self::Shins,
        Self::Feet,
        Self::UpperArms,
        Self::Forearms,
    ];

    /// The region at the height `up` and the distance `aside` from the middle, as shares of the rest
    /// joints' height and of their widest extent.
    fn at(up: f64, aside: f64) -> Self {
        match (up, aside) {
            (0.35.., 0.26..) => Self::Forearms,
            (0.6.., 0.13..) => Self::UpperArms,
            (0.9.., _) => Self::Head,
            (0.7.., _) => Self::Chest,
            (0.5.., _) => Self::Hips,
            (0.3.., _) => Self::Thighs,
            (0.08.., _) => Self::Shins,
            _ => Self::Feet,
        }
    }
}

/// The widest extent of the rest joints: arm span or height, which are nearly the same for a person in a
/// T-pose; in the skeleton's unit.
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
