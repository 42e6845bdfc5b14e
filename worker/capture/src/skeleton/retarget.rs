//! One person's motion on another person's skeleton.

use super::feet::Footing;
use super::transform::compose_axis_angle;
use super::{Pose, Skeleton, SkeletonError, Vec3};
use yoto_proto::pose_track;

/// The driver's motion on the body of `target`: each pose by [`retarget`], and on a body with other
/// proportions with planted feet, which would slide otherwise. The `poses` are at the times `seconds`, in a
/// world with the unit vector `up`.
///
/// # Errors
/// Those of [`retarget`], with the index of the pose.
pub fn transfer(
    driver: &Skeleton,
    target: &Skeleton,
    poses: &[Pose],
    seconds: &[f64],
    up: Vec3,
) -> Result<Vec<Pose>, (usize, SkeletonError)> {
    let moved = poses.iter().enumerate();
    let moved =
        moved.map(|(index, pose)| retarget(driver, target, pose).map_err(|error| (index, error)));
    let mut moved = moved.collect::<Result<Vec<_>, _>>()?;
    if driver.rest != target.rest {
        Footing::of(driver, poses, seconds, up).plant(target, &mut moved, seconds);
    }
    Ok(moved)
}

/// The driver's `pose` on the body of `target`.
///
/// Joints of the same name have the same rotation. The rotation of a driver's joint that the target lacks is
/// composed into the next joint below, so that a hand has the right direction although a collarbone is
/// missing. Joints of the target that the driver lacks stay at rest. The translation is scaled by the ratio
/// of hip heights, so that feet on the floor stay on it and strides fit the legs.
///
/// # Errors
/// The pose does not fit the driver, fewer than half of the smaller skeleton's joint names are shared, or
/// a skeleton's root is no higher (y) than its lowest joint, so that there is no hip height to compare.
pub fn retarget(driver: &Skeleton, target: &Skeleton, pose: &Pose) -> Result<Pose, SkeletonError> {
    driver.check_pose(pose)?;
    let matches: Vec<Option<usize>> = target
        .names
        .iter()
        .map(|name| driver.names.iter().position(|other| other == name))
        .collect();
    let shared = matches.iter().flatten().count();
    let of = driver.joints().min(target.joints());
    if 2 * shared < of {
        return Err(SkeletonError::FewShared {
            shared,
            of,
            driver: lacking(driver, target),
            body: lacking(target, driver),
        });
    }
    let ratio = target.hip_height()? / driver.hip_height()?;
    let rotation = |(joint, found): (usize, &Option<usize>)| {
        found.map_or([0.0; 3], |found| {
            folded(driver, pose, found, above(target, joint, &matches))
        })
    };
    Ok(Pose {
        rotations: matches.iter().enumerate().map(rotation).collect(),
        translation: pose.translation.map(|v| (f64::from(v) * ratio) as f32),
    })
}

/// The driver's counterpart of the target's nearest ancestor of `joint` that has one.
fn above(target: &Skeleton, joint: usize, matches: &[Option<usize>]) -> Option<usize> {
    let mut at = target.parents[joint];
    while let Some(joint) = at {
        if matches[joint].is_some() {
            return matches[joint];
        }
        at = target.parents[joint];
    }
    None
}

/// The rotation of the driver's `joint` relative to `above`, composed over all joints between them; the
/// joint's own rotation if `above` is not its ancestor.
fn folded(driver: &Skeleton, pose: &Pose, joint: usize, above: Option<usize>) -> [f32; 3] {
    let own = pose.rotations[joint];
    let mut rotation = own.map(f64::from);
    let mut at = driver.parents[joint];
    if at == above {
        return own;
    }
    while let Some(between) = at.filter(|_| at != above) {
        rotation = compose_axis_angle(pose.rotations[between].map(f64::from), rotation);
        at = driver.parents[between];
    }
    if at == above {
        rotation.map(|v| v as f32)
    } else {
        own
    }
}

/// Names of joints that `other` lacks, for an error.
fn lacking(skeleton: &Skeleton, other: &Skeleton) -> String {
    const TOLD: usize = 4;
    let names = skeleton.names.iter();
    let names: Vec<&str> = names
        .filter(|name| !other.names.contains(name))
        .map(|name| &**name)
        .collect();
    let told = names.iter().take(TOLD).copied().collect::<Vec<_>>();
    match names.len() {
        0 => "no others".into(),
        more if more > TOLD => format!("{} and {} more", told.join(", "), more - TOLD),
        _ => told.join(", "),
    }
}

impl Skeleton {
    /// The checked skeleton of a motion. Without rest joints it takes those of `body` by name, so that the
    /// motion has the size of that body.
    ///
    /// # Errors
    /// Those of [`Self::from_track`].
    pub fn of_motion(motion: &pose_track::Skeleton, body: &Self) -> Result<Self, SkeletonError> {
        if !motion.rest_joints.is_empty() {
            return Self::from_track(motion);
        }
        let root = body.rest.first().copied().unwrap_or_default();
        let rest = |name: &String| {
            let at = body.names.iter().position(|other| other == name);
            at.and_then(|at| body.rest.get(at)).copied().unwrap_or(root)
        };
        Self::from_track(&pose_track::Skeleton {
            rest_joints: motion.names.iter().map(rest).collect(),
            ..motion.clone()
        })
    }

    /// The root's rest height above the lowest rest joint, metres.
    pub(super) fn hip_height(&self) -> Result<f64, SkeletonError> {
        let root = self.root()[1];
        let lowest = self.rest.iter().map(|p| p[1]).fold(root, f64::min);
        let height = root - lowest;
        if height > 1e-6 {
            Ok(height)
        } else {
            Err(SkeletonError::NoHipHeight)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_synthetic::SyntheticPerson;

    fn legs(names: &[&str], hip: f64) -> Skeleton {
        Skeleton {
            names: names.iter().map(|&n| n.to_owned()).collect(),
            parents: vec![None, Some(0), Some(1)],
            rest: vec![[0.0, hip, 0.0], [0.0, hip / 2.0, 0.0], [0.0, 0.0, 0.0]],
        }
    }

    #[test]
    fn rotations_follow_names_and_translation_follows_height() {
        let driver = legs(&["pelvis", "knee", "ankle"], 1.0);
        let target = legs(&["pelvis", "tail", "knee"], 0.5);
        let pose = Pose {
            rotations: vec![[0.1; 3], [0.2; 3], [0.3; 3]],
            translation: [0.4, -0.2, 1.0],
        };
        let moved = retarget(&driver, &target, &pose).expect("two names are shared");
        assert_eq!(moved.rotations, vec![[0.1; 3], [0.0; 3], [0.2; 3]]);
        assert_eq!(moved.translation, [0.2, -0.1, 0.5]);
        assert_eq!(retarget(&driver, &driver, &pose), Ok(pose));
    }

    #[test]
    fn joints_that_the_body_lacks_are_folded_into_those_below() {
        let driver = SyntheticPerson::cast(1, 7)[0].skeleton();
        let driver = Skeleton::from_track(&driver).expect("a skeleton");
        let kept: Vec<usize> = (0..driver.joints())
            .filter(|at| !["spine1", "spine2", "l_collar"].contains(&&*driver.names[*at]))
            .collect();
        let parent = |at: usize| {
            let mut above = driver.parents[at];
            while let Some(it) = above.filter(|it| !kept.contains(it)) {
                above = driver.parents[it];
            }
            above.and_then(|above| kept.iter().position(|it| *it == above))
        };
        let target = Skeleton {
            names: kept.iter().map(|at| driver.names[*at].clone()).collect(),
            parents: kept.iter().map(|at| parent(*at)).collect(),
            rest: kept.iter().map(|at| driver.rest[*at]).collect(),
        };
        let rotation = |joint: usize| [0.3, -0.2, 0.1].map(|v| v * (1.0 + 0.1 * joint as f32));
        let pose = Pose {
            rotations: (0..driver.joints()).map(rotation).collect(),
            translation: [0.4, 0.1, 1.0],
        };
        let moved = retarget(&driver, &target, &pose).expect("21 names are shared");
        let (from, to) = (
            driver.global_transforms(&pose.rotations_f64()),
            target.global_transforms(&moved.rotations_f64()),
        );
        for (at, joint) in kept.iter().enumerate() {
            for (one, other) in from[*joint].iter().zip(&to[at]) {
                // Directions, not positions: those depend on the bones between.
                let off = one.iter().zip(other).take(3);
                let off = off.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(off < 1e-6, "{}: {off}", driver.names[*joint]);
            }
        }
    }

    #[test]
    fn what_cannot_be_retargeted_is_refused() {
        let driver = legs(&["pelvis", "knee", "ankle"], 1.0);
        let stranger = legs(&["a", "b", "c"], 1.0);
        let pose = Pose::rest(3);
        let text = retarget(&driver, &stranger, &pose).expect_err("no names");
        let text = text.to_string();
        assert!(
            text.contains("share 0 of 3")
                && text.contains("has pelvis, knee, ankle, the body a, b, c"),
            "{text}"
        );
        // One shared name, as a neck, leaves all else at rest.
        let other = legs(&["a", "b", "ankle"], 1.0);
        assert!(retarget(&driver, &other, &pose).is_err());
        assert_eq!(
            retarget(&driver, &driver, &Pose::rest(2)),
            Err(SkeletonError::WrongPose {
                found: 2,
                joints: 3
            })
        );
        let flat = legs(&["pelvis", "knee", "ankle"], 0.0);
        assert_eq!(
            retarget(&driver, &flat, &pose),
            Err(SkeletonError::NoHipHeight)
        );
    }
}
