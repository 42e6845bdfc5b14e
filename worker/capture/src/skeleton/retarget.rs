//! One person's motion on another person's skeleton.

use super::feet::Footing;
use super::transform::after;
use super::{Pose, Skeleton, SkeletonError, Vec3};
use yoto_proto::pose_track;

/// The motion `poses` of `driver`, at `seconds` each and in a world with the unit vector `up`, as `target`
/// would make it: each pose as [`retarget`] has it, and on another body than the driver's with feet that
/// rest where the driver's do, in place of sliding on legs of other proportions.
///
/// # Errors
/// Those of [`retarget`], with the place of the pose.
pub fn transfer(
    driver: &Skeleton,
    target: &Skeleton,
    poses: &[Pose],
    seconds: &[f64],
    up: Vec3,
) -> Result<Vec<Pose>, (usize, SkeletonError)> {
    let moved = poses.iter().enumerate();
    let moved = moved.map(|(at, pose)| retarget(driver, target, pose).map_err(|error| (at, error)));
    let mut moved = moved.collect::<Result<Vec<_>, _>>()?;
    if driver.rest != target.rest {
        Footing::of(driver, poses, seconds, up).plant(target, &mut moved, seconds);
    }
    Ok(moved)
}

/// `pose` of `driver`, as `target` would take it.
///
/// Joints of the same name turn alike; those of the driver that the target lacks are folded into the
/// next ones below, so that a hand goes where it goes although a collarbone is missing; joints of the
/// target that the driver lacks stay at rest. The translation is scaled by the ratio of hip
/// heights, so that feet which stood on the floor stand on it again and strides fit the legs.
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
    let turn = |(joint, found): (usize, &Option<usize>)| {
        found.map_or([0.0; 3], |found| {
            folded(driver, pose, found, above(target, joint, &matches))
        })
    };
    Ok(Pose {
        rotations: matches.iter().enumerate().map(turn).collect(),
        translation: pose.translation.map(|v| (f64::from(v) * ratio) as f32),
    })
}

/// The driver's joint that moves the nearest joint above `joint` that anything moves.
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

/// The rotation of the driver's `joint` against `above`, over all joints between them; its own where
/// `above` is not above it.
fn folded(driver: &Skeleton, pose: &Pose, joint: usize, above: Option<usize>) -> [f32; 3] {
    let own = pose.rotations[joint];
    let mut turn = own.map(f64::from);
    let mut at = driver.parents[joint];
    if at == above {
        return own;
    }
    while let Some(between) = at.filter(|_| at != above) {
        turn = after(pose.rotations[between].map(f64::from), turn);
        at = driver.parents[between];
    }
    if at == above {
        turn.map(|v| v as f32)
    } else {
        own
    }
}

/// Names of joints that `other` lacks, for people.
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
    /// The checked skeleton of a motion. Without rest joints it has those of `body` by name, so that the motion
    /// has the size of whoever takes it.
    ///
    /// # Errors
    /// Those of [`Self::from_track`].
    pub fn of_motion(motion: &pose_track::Skeleton, body: &Self) -> Result<Self, SkeletonError> {
        if !motion.rest_joints.is_empty() {
            return Self::from_track(motion);
        }
        let root = body.rest.first().copied().unwrap_or_default();
        let place = |name: &String| {
            let at = body.names.iter().position(|other| other == name);
            at.and_then(|at| body.rest.get(at)).copied().unwrap_or(root)
        };
        Self::from_track(&pose_track::Skeleton {
            rest_joints: motion.names.iter().map(place).collect(),
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
        let turn = |joint: usize| [0.3, -0.2, 0.1].map(|v| v * (1.0 + 0.1 * joint as f32));
        let pose = Pose {
            rotations: (0..driver.joints()).map(turn).collect(),
            translation: [0.4, 0.1, 1.0],
        };
        let moved = retarget(&driver, &target, &pose).expect("21 names are shared");
        let (from, to) = (
            driver.global_transforms(&pose.rotations_f64()),
            target.global_transforms(&moved.rotations_f64()),
        );
        for (at, joint) in kept.iter().enumerate() {
            for (one, other) in from[*joint].iter().zip(&to[at]) {
                // Directions, not places: those depend on the bones between.
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
