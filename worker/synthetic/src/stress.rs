//! Poses that films rarely have, and a calm film of anybody: what a person filmed in a turn with arms down looks like
//! elsewhere.

use super::build::joint::{
    HEAD, L_ANKLE, L_COLLAR, L_ELBOW, L_HIP, L_KNEE, L_SHOULDER, NECK, PELVIS, SPINE1, SPINE2,
    SPINE3,
};
use super::motion::{Stance, wrapped};
use std::f64::consts::TAU;
use yoto_capture::skeleton::transform::compose_axis_angle;
use yoto_capture::skeleton::{Pose, Skeleton, Vec3};

/// The rotation of a shoulder from the T-pose to the side of the body, radians.
const DOWN: f64 = -1.25;
/// Steps in a calm film.
const STEPS: f64 = 6.0;

/// A pose and what it is called.
#[derive(Clone, Debug)]
pub struct NamedPose {
    /// The name, of letters and hyphens.
    pub name: &'static str,
    /// The pose; its lowest foot is on the floor.
    pub pose: Pose,
}

/// Rotations of joints, axis-angle, radians. Those of a left joint are mirrored for the right one.
enum Turn {
    One(usize, Vec3),
    Both(usize, Vec3),
    /// Both joints, by two rotations one after the other.
    BothThen(usize, Vec3, Vec3),
}

use Turn::{Both, BothThen, One};

const R_HIP: usize = L_HIP + 1;
const R_KNEE: usize = L_KNEE + 1;
const R_ANKLE: usize = L_ANKLE + 1;
const R_SHOULDER: usize = L_SHOULDER + 1;
const R_ELBOW: usize = L_ELBOW + 1;
const ARMS_DOWN: Turn = Both(L_SHOULDER, [0.0, 0.0, DOWN]);

/// The poses, in the T-pose where nothing is said. At the left, a negative z lowers an arm, a negative y brings it forward; a negative
/// x lifts a leg forward, and a positive one bends a knee.
const POSES: [(&str, &[Turn]); 24] = [
    (
        "arms-up",
        &[
            Both(L_COLLAR, [0.0, 0.0, 0.25]),
            Both(L_SHOULDER, [0.0, 0.0, 1.2]),
        ],
    ),
    ("arms-out", &[]),
    ("arms-forward", &[Both(L_SHOULDER, [0.0, -1.5, 0.0])]),
    (
        "arms-crossed",
        &[
            BothThen(L_SHOULDER, [0.0, -0.7, 0.0], [0.0, 0.0, -1.0]),
            Both(L_ELBOW, [0.0, -1.9, 0.0]),
        ],
    ),
    (
        "hands-on-hips",
        &[
            BothThen(L_SHOULDER, [0.0, 0.5, 0.0], [0.0, 0.0, -0.8]),
            Both(L_ELBOW, [0.0, -1.6, 0.0]),
        ],
    ),
    (
        "hands-behind-head",
        &[
            Both(L_COLLAR, [0.0, 0.0, 0.15]),
            Both(L_SHOULDER, [0.0, 0.0, 0.6]),
            Both(L_ELBOW, [0.0, -0.6, 2.0]),
        ],
    ),
    (
        "one-arm-up",
        &[
            One(L_SHOULDER, [0.0, 0.0, 1.35]),
            One(R_SHOULDER, [0.0, 0.0, -DOWN]),
        ],
    ),
    (
        "waving",
        &[
            One(R_SHOULDER, [0.0, 0.0, -0.1]),
            One(R_ELBOW, [0.0, 0.3, -1.5]),
            One(L_SHOULDER, [0.0, 0.0, DOWN]),
        ],
    ),
    (
        "reaching-across",
        &[
            One(L_SHOULDER, [0.0, -2.0, 0.0]),
            One(R_SHOULDER, [0.0, 0.0, -DOWN]),
            One(SPINE3, [0.0, -0.3, 0.0]),
        ],
    ),
    (
        "half-squat",
        &[
            ARMS_DOWN,
            Both(L_HIP, [-0.8, 0.0, 0.15]),
            Both(L_KNEE, [1.2, 0.0, 0.0]),
            Both(L_ANKLE, [-0.4, 0.0, -0.1]),
            One(SPINE1, [0.25, 0.0, 0.0]),
        ],
    ),
    (
        "deep-squat",
        &[
            Both(L_SHOULDER, [0.0, -1.4, 0.0]),
            Both(L_HIP, [-1.9, 0.0, 0.25]),
            Both(L_KNEE, [2.3, 0.0, 0.0]),
            Both(L_ANKLE, [-0.6, 0.0, -0.15]),
            One(SPINE1, [0.35, 0.0, 0.0]),
            One(SPINE2, [0.2, 0.0, 0.0]),
            One(NECK, [-0.3, 0.0, 0.0]),
        ],
    ),
    (
        "lunge",
        &[
            ARMS_DOWN,
            One(L_HIP, [-1.4, 0.0, 0.0]),
            One(L_KNEE, [1.5, 0.0, 0.0]),
            One(R_HIP, [0.5, 0.0, 0.0]),
            One(R_KNEE, [0.5, 0.0, 0.0]),
            One(R_ANKLE, [0.3, 0.0, 0.0]),
        ],
    ),
    (
        "kick",
        &[
            ARMS_DOWN,
            One(R_HIP, [-1.5, 0.0, 0.0]),
            One(R_KNEE, [0.15, 0.0, 0.0]),
            One(SPINE1, [-0.1, 0.0, 0.0]),
        ],
    ),
    (
        "side-kick",
        &[
            Both(L_SHOULDER, [0.0, 0.0, -0.5]),
            One(L_HIP, [0.0, 0.0, 1.1]),
            One(SPINE1, [0.0, 0.0, 0.3]),
        ],
    ),
    (
        "knee-up",
        &[
            ARMS_DOWN,
            One(L_HIP, [-1.8, 0.0, 0.0]),
            One(L_KNEE, [1.9, 0.0, 0.0]),
        ],
    ),
    (
        "sitting",
        &[
            ARMS_DOWN,
            Both(L_HIP, [-1.5, 0.0, 0.1]),
            Both(L_KNEE, [1.5, 0.0, 0.0]),
            Both(L_ELBOW, [0.0, -0.8, 0.0]),
        ],
    ),
    (
        "kneeling",
        &[
            ARMS_DOWN,
            Both(L_HIP, [-0.1, 0.0, 0.1]),
            Both(L_KNEE, [1.7, 0.0, 0.0]),
            Both(L_ANKLE, [0.6, 0.0, 0.0]),
        ],
    ),
    (
        "bending-forward",
        &[
            BothThen(L_SHOULDER, [-1.2, 0.0, 0.0], [0.0, 0.0, DOWN]),
            Both(L_HIP, [-0.9, 0.0, 0.0]),
            One(SPINE1, [0.4, 0.0, 0.0]),
            One(SPINE2, [0.3, 0.0, 0.0]),
            One(SPINE3, [0.2, 0.0, 0.0]),
        ],
    ),
    (
        "bending-back",
        &[
            ARMS_DOWN,
            One(SPINE1, [-0.3, 0.0, 0.0]),
            One(SPINE2, [-0.25, 0.0, 0.0]),
            One(SPINE3, [-0.15, 0.0, 0.0]),
        ],
    ),
    (
        "bending-aside",
        &[
            One(L_SHOULDER, [0.0, 0.0, 1.3]),
            One(R_SHOULDER, [0.0, 0.0, -DOWN]),
            One(SPINE1, [0.0, 0.0, -0.3]),
            One(SPINE2, [0.0, 0.0, -0.25]),
        ],
    ),
    (
        "twisting",
        &[
            ARMS_DOWN,
            One(SPINE1, [0.0, 0.35, 0.0]),
            One(SPINE2, [0.0, 0.3, 0.0]),
            One(SPINE3, [0.0, 0.25, 0.0]),
            One(HEAD, [0.0, 0.5, 0.0]),
        ],
    ),
    (
        "legs-wide",
        &[
            Both(L_SHOULDER, [0.0, 0.0, -0.6]),
            Both(L_HIP, [0.0, 0.0, 0.75]),
            Both(L_ANKLE, [0.0, 0.0, -0.5]),
        ],
    ),
    (
        "legs-crossed",
        &[
            ARMS_DOWN,
            One(L_HIP, [-0.2, 0.0, -0.3]),
            One(R_HIP, [0.1, 0.0, 0.25]),
            One(HEAD, [-0.4, -0.5, 0.0]),
        ],
    ),
    (
        "star-jump",
        &[
            Both(L_COLLAR, [0.0, 0.0, 0.15]),
            Both(L_SHOULDER, [0.0, 0.0, 0.75]),
            Both(L_HIP, [0.0, 0.0, 0.5]),
        ],
    ),
];

/// The poses of a skeleton with SMPL's joints and a T-pose at rest, facing +z.
pub fn stress_poses(skeleton: &Skeleton) -> Vec<NamedPose> {
    let pose = |(name, turns): &(&'static str, &[Turn])| {
        let mut stance = Stance::rest(skeleton);
        for turn in *turns {
            match turn {
                One(joint, rotation) => stance.set(*joint, *rotation),
                Both(left, rotation) => stance.set_both(*left, *rotation),
                BothThen(left, then, first) => {
                    stance.set_both(*left, compose_axis_angle(*then, *first));
                }
            }
        }
        let pose = stance.stand(skeleton, 0.0);
        NamedPose { name, pose }
    };
    POSES.iter().map(pose).collect()
}

/// `frames` poses of somebody with SMPL's joints who walks on the spot, arms down: in one whole turn, or within `sector` radians to
/// either side of the camera.
pub fn calm_motion(skeleton: &Skeleton, frames: usize, sector: Option<f64>) -> Vec<Pose> {
    let pose = |frame: usize| {
        let time = frame as f64 / frames.max(1) as f64;
        let step = (TAU * STEPS * time).sin();
        let facing = sector.map_or(TAU * time, |sector| sector * (TAU * time).sin());
        let mut stance = Stance::rest(skeleton);
        stance.set(PELVIS, [0.0, wrapped(facing), 0.0]);
        for (side, sign) in [(0, 1.0), (1, -1.0)] {
            let ahead = sign * step;
            stance.set(L_HIP + side, [-0.25 * ahead - 0.1, 0.0, 0.0]);
            stance.set(L_KNEE + side, [0.2 + 0.2 * ahead, 0.0, 0.0]);
            let swing = [0.3 * ahead, 0.0, 0.0];
            let lowered = [0.0, 0.0, sign * (DOWN + 0.1 * ahead.abs())];
            stance.set(L_SHOULDER + side, compose_axis_angle(swing, lowered));
            stance.set(L_ELBOW + side, [0.0, -sign * (0.2 + 0.1 * ahead), 0.0]);
        }
        stance.set(HEAD, [0.0, 0.2 * (TAU * 2.0 * time).sin(), 0.0]);
        stance.stand(skeleton, 0.0)
    };
    (0..frames).map(pose).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SyntheticPerson;
    use std::collections::BTreeSet;

    fn skeleton() -> Skeleton {
        SyntheticPerson::cast(1, 7)[0].skeleton.clone()
    }

    #[test]
    fn the_poses_differ_and_stand_on_the_floor() {
        let skeleton = skeleton();
        let poses = stress_poses(&skeleton);
        let names: BTreeSet<&str> = poses.iter().map(|it| it.name).collect();
        assert_eq!(names.len(), POSES.len());
        let joints = |name: &str| {
            let pose = poses.iter().find(|it| it.name == name).expect("is there");
            skeleton.posed_joints(&pose.pose)
        };
        const L_WRIST: usize = 20;
        assert!(joints("arms-up")[L_WRIST][1] > joints("arms-out")[HEAD][1]);
        assert!(joints("arms-forward")[L_WRIST][2] > 0.4);
        assert!(joints("deep-squat")[PELVIS][1] < 0.6 * joints("arms-out")[PELVIS][1]);
        assert!(joints("kick")[R_ANKLE][2] > 0.5);
        let lowest = |pose: &Pose| {
            let joints = skeleton.posed_joints(pose);
            let feet = joints[7..9].iter().chain(&joints[10..12]);
            feet.map(|joint| joint[1]).fold(f64::INFINITY, f64::min)
        };
        let floor = lowest(&Pose::rest(skeleton.joints()));
        assert!(
            poses
                .iter()
                .all(|it| (lowest(&it.pose) - floor).abs() < 1e-5)
        );
    }

    #[test]
    fn a_calm_film_keeps_the_arms_down_and_stays_in_its_sector() {
        let skeleton = skeleton();
        let film = calm_motion(&skeleton, 40, Some(0.7));
        for pose in &film {
            assert!(pose.rotations[PELVIS][1].abs() <= 0.701);
            let joints = skeleton.posed_joints(pose);
            assert!(joints[20][1] < joints[L_SHOULDER][1] - 0.25);
        }
        let turn = calm_motion(&skeleton, 40, None);
        assert!(
            turn.iter()
                .any(|pose| pose.rotations[PELVIS][1].abs() > 3.0)
        );
    }
}
