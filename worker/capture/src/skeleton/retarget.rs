//! One person's motion on another person's skeleton.

use super::feet::Footing;
use super::fingers::relaxed;
use super::smpl::joints_of_body;
use super::transform::{add, compose_axis_angle, dot, scale, sub};
use super::{Pose, Skeleton, SkeletonError, Vec3};
use yoto_proto::pose_track;

/// The joints of SMPL's hands, and the joints of fingers that lie there.
const MITTENS: [(&str, &str); 2] = [("l_hand", "l_middle1"), ("r_hand", "r_middle1")];

/// The driver's motion on the body of `target`: joints of the same name turn alike, the root moves as [`carry`] says,
/// and on a body with other proportions feet are planted, which would slide otherwise. The `poses` are at the times
/// `seconds`, in a world with the unit vector `up`.
///
/// # Errors
/// With the index of the pose: it does not fit the driver, fewer than half of the smaller skeleton's joint names are
/// shared, or a skeleton's root is no higher (y) than its lowest joint, so that there is no hip height to compare.
pub fn transfer(
    driver: &Skeleton,
    target: &Skeleton,
    poses: &[Pose],
    seconds: &[f64],
    up: Vec3,
) -> Result<Vec<Pose>, (usize, SkeletonError)> {
    let mut moved = carried(driver, target, poses, up)?;
    if driver.rest != target.rest {
        Footing::of(driver, poses, seconds, up).plant(target, &mut moved, seconds);
    }
    Ok(moved)
}

/// Transfers a pose as [`transfer`] does, but feet may slide.
pub(super) fn carried(
    driver: &Skeleton,
    target: &Skeleton,
    poses: &[Pose],
    up: Vec3,
) -> Result<Vec<Pose>, (usize, SkeletonError)> {
    let turned = poses.iter().enumerate();
    let turned = turned
        .map(|(index, pose)| turned_alike(driver, target, pose).map_err(|error| (index, error)));
    let mut moved = turned.collect::<Result<Vec<_>, _>>()?;
    if driver.rest != target.rest {
        carry(driver, target, poses, &mut moved, up).map_err(|error| (0, error))?;
    }
    Ok(moved)
}

/// Moves the root of `target` in the poses `moved` as the driver's moves in its `poses`: over the same floor, from the
/// place over which the driver's begins, with heights and strides scaled by the ratio of hip heights, so that feet on
/// the floor stay on it and strides fit the legs. Where skeletons have their origins does not matter: some have theirs
/// on the floor, others at the pelvis.
fn carry(
    driver: &Skeleton,
    target: &Skeleton,
    poses: &[Pose],
    moved: &mut [Pose],
    up: Vec3,
) -> Result<(), SkeletonError> {
    let ratio = target.hip_height()? / driver.hip_height()?;
    let root = |pose: &Pose| add(driver.root(), pose.translation.map(f64::from));
    let Some(first) = poses.first().map(root) else {
        return Ok(());
    };
    let floor = driver.floor(poses, up);
    let below = sub(first, scale(up, dot(first, up) - floor));
    for (pose, moved) in poses.iter().zip(moved) {
        let place = add(below, scale(sub(root(pose), below), ratio));
        moved.translation = sub(place, target.root()).map(|v| v as f32);
    }
    Ok(())
}

/// The driver's `pose` on the body of `target`, where the driver's root is.
///
/// Joints of the same name have the same rotation. The rotation of a driver's joint that the target lacks is
/// composed into the next joint below, so that a hand has the right direction although a collarbone is
/// missing. Joints of the target that the driver lacks stay at rest; fingers are slightly bent then.
fn turned_alike(driver: &Skeleton, target: &Skeleton, pose: &Pose) -> Result<Pose, SkeletonError> {
    driver.check_pose(pose)?;
    let find = |name: &str| driver.names.iter().position(|other| other == name);
    let matches: Vec<Option<usize>> = target
        .names
        .iter()
        .map(|name| {
            find(name).or_else(|| {
                // A hand without fingers bends as its middle finger does.
                let (_, finger) = MITTENS.iter().find(|(hand, _)| hand == name)?;
                find(finger).filter(|_| !target.names.iter().any(|other| other == finger))
            })
        })
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
    let has_fingers = joints_of_body(target) < target.joints();
    let rotation = |(joint, found): (usize, &Option<usize>)| match found {
        Some(found) => folded(driver, pose, *found, above(target, joint, &matches)),
        None if has_fingers => relaxed(joint).unwrap_or_default(),
        None => [0.0; 3],
    };
    Ok(Pose {
        rotations: matches.iter().enumerate().map(rotation).collect(),
        translation: pose.translation,
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
    /// motion has the size of that body. Joints that the body lacks, such as fingers, are where their parents are.
    ///
    /// # Errors
    /// The same errors as [`Self::from_track`].
    pub fn of_motion(motion: &pose_track::Skeleton, body: &Self) -> Result<Self, SkeletonError> {
        if !motion.rest_joints.is_empty() {
            return Self::from_track(motion);
        }
        let root = body.rest.first().copied().unwrap_or_default();
        let mut rest: Vec<Vec3> = Vec::with_capacity(motion.names.len());
        for (joint, name) in motion.names.iter().enumerate() {
            let at = body.names.iter().position(|other| other == name);
            let own = at.and_then(|at| body.rest.get(at));
            let parent = motion.parents.get(joint);
            let above = parent.and_then(|it| rest.get(usize::try_from(*it).ok()?));
            rest.push(own.or(above).copied().unwrap_or(root));
        }
        Self::from_track(&pose_track::Skeleton {
            rest_joints: rest,
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
    use crate::skeleton::fingers::with_fingers;
    use yoto_synthetic::SyntheticPerson;

    fn legs(names: &[&str], hip: f64) -> Skeleton {
        Skeleton {
            names: names.iter().map(|&n| n.to_owned()).collect(),
            parents: vec![None, Some(0), Some(1)],
            rest: vec![[0.0, hip, 0.0], [0.0, hip / 2.0, 0.0], [0.0, 0.0, 0.0]],
        }
    }

    const UP: Vec3 = [0.0, 1.0, 0.0];

    fn on(driver: &Skeleton, target: &Skeleton, pose: &Pose) -> Result<Pose, SkeletonError> {
        let moved = transfer(driver, target, std::slice::from_ref(pose), &[0.0], UP);
        let moved = moved.map_err(|(_, error)| error)?;
        Ok(moved.into_iter().next().expect("a pose"))
    }

    #[test]
    fn rotations_follow_names_and_heights_follow_the_legs() {
        let driver = legs(&["pelvis", "knee", "ankle"], 1.0);
        let target = legs(&["pelvis", "tail", "knee"], 0.5);
        let pose = Pose {
            rotations: vec![[0.1; 3], [0.2; 3], [0.3; 3]],
            translation: [0.4, -0.2, 1.0],
        };
        let moved = on(&driver, &target, &pose).expect("two names are shared");
        assert_eq!(moved.rotations, vec![[0.1; 3], [0.0; 3], [0.2; 3]]);
        assert_eq!(on(&driver, &driver, &pose), Ok(pose));
        // A straight leg stands on a floor at -0.2; half as long, on the same floor and place.
        let straight = Pose {
            rotations: vec![[0.0; 3]; 3],
            translation: [0.4, -0.2, 1.0],
        };
        let moved = on(&driver, &target, &straight).expect("fits");
        assert_eq!(moved.translation, [0.4, -0.2, 1.0]);
        let feet = target.posed_joints(&moved)[2];
        assert!((feet[1] + 0.2).abs() < 1e-6, "{feet:?}");
    }

    #[test]
    fn where_a_skeleton_has_its_origin_does_not_matter() {
        // In a camera's axes, y down, as trackers write it; the root turns upside down for that.
        let turned = |steps: f32| Pose {
            rotations: vec![[std::f32::consts::PI, 0.0, 0.0], [0.0; 3], [0.0; 3]],
            translation: [0.1, 0.3, 3.0 + steps],
        };
        let poses: Vec<Pose> = [0.0, 0.3, 0.6].map(turned).into();
        let down = [0.0, -1.0, 0.0];
        let names = ["pelvis", "knee", "ankle"];
        let driver = legs(&names, 1.0);
        let moved_by = |mut body: Skeleton, by: f64| {
            body.rest.iter_mut().for_each(|joint| joint[1] += by);
            body
        };
        let shifted: Vec<Pose> = poses
            .iter()
            .map(|pose| Pose {
                translation: [
                    pose.translation[0],
                    pose.translation[1] + 1.26,
                    pose.translation[2],
                ],
                ..pose.clone()
            })
            .collect();
        let target = legs(&names, 1.1);
        let places = |driver: &Skeleton, poses: &[Pose], target: &Skeleton| {
            let moved = transfer(driver, target, poses, &[0.0, 0.1, 0.2], down).expect("fits");
            let joints = moved.iter().map(|pose| target.posed_joints(pose));
            joints.collect::<Vec<_>>()
        };
        let wanted = places(&driver, &poses, &target);
        // The feet of both are on one floor.
        let lowest = driver.posed_joints(&poses[0])[2];
        assert!(
            (wanted[0][2][1] - lowest[1]).abs() < 1e-5,
            "{wanted:?} {lowest:?}"
        );
        // A stride is a tenth longer.
        assert!((wanted[2][0][2] - wanted[0][0][2] - 0.66).abs() < 1e-5);
        let same = |found: Vec<Vec<Vec3>>| {
            for (found, wanted) in found.iter().flatten().zip(wanted.iter().flatten()) {
                for axis in 0..3 {
                    assert!(
                        (found[axis] - wanted[axis]).abs() < 1e-5,
                        "{found:?} {wanted:?}"
                    );
                }
            }
        };
        same(places(&moved_by(driver.clone(), -1.26), &shifted, &target));
        same(places(&driver, &poses, &moved_by(target.clone(), 0.7)));
    }

    #[test]
    fn a_hand_without_fingers_bends_as_the_middle_finger_does() {
        let body = SyntheticPerson::cast(1, 7)[0].skeleton();
        let body = Skeleton::from_track(&body).expect("a skeleton");
        let mut driver = with_fingers(&body).expect("SMPL's joints");
        let at = |skeleton: &Skeleton, name: &str| {
            let found = skeleton.names.iter().position(|other| other == name);
            found.expect("a joint")
        };
        let hand = at(&driver, "l_hand");
        driver.names[hand] = "tool".into();
        let mut pose = Pose::rest(driver.joints());
        pose.rotations[at(&driver, "l_middle1")] = [0.0, 0.0, -0.8];
        let moved = on(&driver, &body, &pose).expect("fits");
        assert_eq!(moved.rotations[hand], [0.0, 0.0, -0.8]);
        // A hand with fingers bends those.
        let hands = with_fingers(&body).expect("SMPL's joints");
        let moved = on(&driver, &hands, &pose).expect("fits");
        assert_eq!(moved.rotations[hand], [0.0; 3]);
        assert_eq!(moved.rotations[at(&hands, "l_middle1")], [0.0, 0.0, -0.8]);
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
        let moved = on(&driver, &target, &pose).expect("21 names are shared");
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
    fn fingers_are_those_of_the_driver_or_half_open() {
        let person = SyntheticPerson::cast(1, 7)[0].skeleton();
        let plain = Skeleton::from_track(&person).expect("a skeleton");
        let fingered = with_fingers(&plain).expect("SMPL's joints");
        let mut pose = Pose::rest(54);
        pose.rotations[25] = [0.0, 0.1, -0.9];
        let moved = on(&fingered, &fingered, &pose).expect("the same joints");
        assert_eq!(moved.rotations[25], pose.rotations[25]);
        // Somebody without fingers lets them hang; the thumb stays.
        let moved = on(&plain, &fingered, &Pose::rest(24)).expect("24 names are shared");
        let [left, right] = [25, 40].map(|joint| moved.rotations[joint][2]);
        assert!(left < -0.3 && (left + right).abs() < 1e-6, "{left} {right}");
        assert_eq!(moved.rotations[36], [0.0; 3]);
        assert_eq!(moved.rotations[..24], vec![[0.0; 3]; 24]);
        let moved = on(&fingered, &plain, &pose).expect("24 names are shared");
        assert_eq!(moved.rotations, vec![[0.0; 3]; 24]);
    }

    #[test]
    fn fingers_of_a_motion_that_the_body_lacks_stay_at_the_wrists() {
        let person = SyntheticPerson::cast(1, 7)[0].skeleton();
        let body = Skeleton::from_track(&person).expect("a skeleton");
        let motion = pose_track::Skeleton {
            rest_joints: Vec::new(),
            ..with_fingers(&body).expect("SMPL's joints").to_track()
        };
        let driver = Skeleton::of_motion(&motion, &body).expect("a skeleton");
        assert_eq!(driver.rest[..24], body.rest);
        for joint in 24..54 {
            let wrist = if joint < 39 { 20 } else { 21 };
            assert_eq!(driver.rest[joint], body.rest[wrist], "{joint}");
        }
    }

    #[test]
    fn what_cannot_be_retargeted_is_refused() {
        let driver = legs(&["pelvis", "knee", "ankle"], 1.0);
        let stranger = legs(&["a", "b", "c"], 1.0);
        let pose = Pose::rest(3);
        let text = on(&driver, &stranger, &pose).expect_err("no names");
        let text = text.to_string();
        assert!(
            text.contains("share 0 of 3")
                && text.contains("has pelvis, knee, ankle, the body a, b, c"),
            "{text}"
        );
        // One shared name, as a neck, leaves all else at rest.
        let other = legs(&["a", "b", "ankle"], 1.0);
        assert!(on(&driver, &other, &pose).is_err());
        assert_eq!(
            on(&driver, &driver, &Pose::rest(2)),
            Err(SkeletonError::WrongPose {
                found: 2,
                joints: 3
            })
        );
        let flat = legs(&["pelvis", "knee", "ankle"], 0.0);
        assert_eq!(on(&driver, &flat, &pose), Err(SkeletonError::NoHipHeight));
    }
}
