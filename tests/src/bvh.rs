//! Pose tracks as BVH files, as motion-capture programs write them.

use std::fmt::Write;
use yoto_capture::skeleton::transform::{Mat3, matmul, matvec, rodrigues, transpose};
use yoto_proto::pose_track::{PoseTrack, Skeleton};

/// No rotation.
pub const UNTURNED: Mat3 = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// SMPL's joints, as Mixamo calls them.
pub const MIXAMO: [&str; 24] = [
    "Hips",
    "LeftUpLeg",
    "RightUpLeg",
    "Spine",
    "LeftLeg",
    "RightLeg",
    "Spine1",
    "LeftFoot",
    "RightFoot",
    "Spine2",
    "LeftToeBase",
    "RightToeBase",
    "Neck",
    "LeftShoulder",
    "RightShoulder",
    "Head",
    "LeftArm",
    "RightArm",
    "LeftForeArm",
    "RightForeArm",
    "LeftHand",
    "RightHand",
    "LeftHandMiddle1",
    "RightHandMiddle1",
];

/// Writes `track`, which has SMPL's joints, with Mixamo's names, in units of `unit` metres. `world` rotates the
/// track's world into the file's, `rest` SMPL's rest pose into the file's.
pub fn bvh(track: &PoseTrack, unit: f64, world: &Mat3, rest: &Mat3) -> String {
    let mut text = "HIERARCHY\n".to_owned();
    let mut order = Vec::new();
    let rotation = rest;
    let mut resting = track.skeleton.clone();
    for joint in &mut resting.rest_joints {
        *joint = matvec(rotation, *joint).map(|v| v / unit);
    }
    joint(&mut text, &resting, 0, 0, &mut order);
    let _ = writeln!(
        text,
        "MOTION\nFrames: {}\nFrame Time: {:.7}",
        track.frames.len(),
        1.0 / track.fps
    );
    let rest = track.skeleton.rest_joints[0];
    for frame in &track.frames {
        let position = std::array::from_fn(|i| (rest[i] + frame.translation[i]) / unit);
        let mut numbers: Vec<f64> = matvec(world, position).to_vec();
        for at in &order {
            let r = &frame.pose[3 * at..3 * at + 3];
            let local = rodrigues([r[0], r[1], r[2]]);
            let above = if *at == 0 { world } else { rotation };
            let local = matmul(&matmul(above, &local), &transpose(rotation));
            numbers.extend(zxy(&local).map(f64::to_degrees));
        }
        let line: Vec<String> = numbers.iter().map(|it| format!("{it:.6}")).collect();
        let _ = writeln!(text, "{}", line.join(" "));
    }
    text
}

/// Writes a joint with all below it, and adds them to the `order` of channels.
fn joint(text: &mut String, skeleton: &Skeleton, at: usize, depth: usize, order: &mut Vec<usize>) {
    let (kind, channels) = match depth {
        0 => ("ROOT", "6 Xposition Yposition Zposition"),
        _ => ("JOINT", "3"),
    };
    let offset: [f64; 3] = match usize::try_from(skeleton.parents[at]) {
        Ok(above) => {
            std::array::from_fn(|i| skeleton.rest_joints[at][i] - skeleton.rest_joints[above][i])
        }
        Err(_) => [0.0; 3],
    };
    let [x, y, z] = offset;
    let _ = writeln!(
        text,
        "{kind} {}\n{{\nOFFSET {x:.6} {y:.6} {z:.6}\nCHANNELS {channels} Zrotation Xrotation Yrotation",
        MIXAMO[at]
    );
    order.push(at);
    let below: Vec<usize> = (0..skeleton.names.len())
        .filter(|it| usize::try_from(skeleton.parents[*it]) == Ok(at))
        .collect();
    if below.is_empty() {
        text.push_str("End Site\n{\nOFFSET 0 0.01 0\n}\n");
    }
    for it in below {
        joint(text, skeleton, it, depth + 1, order);
    }
    text.push_str("}\n");
}

/// Angles about z, x and y, radians, of the rotation by the one about y first.
fn zxy(r: &Mat3) -> [f64; 3] {
    [
        (-r[0][1]).atan2(r[1][1]),
        r[2][1].clamp(-1.0, 1.0).asin(),
        (-r[2][0]).atan2(r[2][2]),
    ]
}
