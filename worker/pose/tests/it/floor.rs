//! Depths of feet that stand on a floor.

use crate::people::{Errors, camera, clip, joints};
use yoto_capture::skeleton::Skeleton;
use yoto_pose::{FitOptions, KeyPointSet, fit};
use yoto_synthetic::{SyntheticPerson, stress_poses};

/// Ankles of the 24 joints.
const ANKLES: [usize; 2] = [7, 8];
/// The left knee, and the left ankle, heel and toe, among the points of BlazePose.
const KNEE: usize = 25;
const FOOT: [usize; 3] = [27, 29, 31];
/// How much nearer than it is the detector takes that foot to be, metres.
const NEARER: f64 = 0.2;

/// Somebody stands straight, and the detector takes one foot to be nearer than the other.
#[test]
fn a_floor_tells_depths_that_a_detector_does_not_know() {
    let person = &SyntheticPerson::cast(3, 7)[1];
    let skeleton = Skeleton::from_track(&person.skeleton()).expect("a skeleton");
    let mut poses = stress_poses(&skeleton).into_iter();
    let standing = poses.find(|it| it.name == "arms-out").expect("a pose");
    let errors = Errors {
        picture: 0.003,
        space: Some(0.02),
    };
    let camera = camera(3.0, [720, 1280], 1500.0);
    let poses = vec![standing.pose; 15];
    let mut clip = clip(person, &poses, &camera, KeyPointSet::BlazePose33, errors, 1);
    for frame in &mut clip.points.frames {
        frame.space[KNEE][2] -= 0.5 * NEARER;
        FOOT.iter().for_each(|foot| frame.space[*foot][2] -= NEARER);
    }
    let fitted = fit(&clip.points, &FitOptions::default(), &mut |_, _| ()).expect("fits");
    let apart = |frame: &[[f64; 3]]| frame[ANKLES[0]][2] - frame[ANKLES[1]][2];
    let found = joints(&fitted);
    let off = apart(&found[7]) - apart(&clip.joints[7]);
    // Without the floor it is 61 mm.
    assert!(off.abs() < 0.05, "{off} m");
}
