//! The skeleton of MHR, as SAM 3D Body's files have it in each frame: `pred_global_rots` `[127, 3, 3]` and
//! `pred_joint_coords` `[127, 3]`.
//!
//! 22 of the 127 joints are kept. Fingers are merged into the wrists, jaw, tongue and eyes into the
//! head, toes into the ball; helpers that spread a twist over a limb (`_proc`) move with the limb, and
//! joints between kept ones (the ankle's parts, the forearm's twist) are folded into those below.

use crate::ImportError;
use crate::geometry::{Mat3, exact_rotation, matmul};
use crate::hierarchy::{GlobalPose, Joint, JointHierarchy};
use crate::source::Part;

/// A kept joint: its number, its name, the kept joint above, and the joint of SMPL that it stands for.
type KeptJoint = (usize, &'static str, usize, &'static str);

/// The kept joints; the first is the root.
const JOINTS: [KeptJoint; 22] = [
    (1, "root", 1, "pelvis"),
    (2, "l_upleg", 1, "l_hip"),
    (3, "l_lowleg", 2, "l_knee"),
    (4, "l_foot", 3, "l_ankle"),
    (8, "l_ball", 4, "l_foot"),
    (18, "r_upleg", 1, "r_hip"),
    (19, "r_lowleg", 18, "r_knee"),
    (20, "r_foot", 19, "r_ankle"),
    (24, "r_ball", 20, "r_foot"),
    (35, "c_spine1", 1, "spine1"),
    (36, "c_spine2", 35, "spine2"),
    (37, "c_spine3", 36, "spine3"),
    (38, "r_clavicle", 37, "r_collar"),
    (39, "r_uparm", 38, "r_shoulder"),
    (40, "r_lowarm", 39, "r_elbow"),
    (42, "r_wrist", 40, "r_wrist"),
    (74, "l_clavicle", 37, "l_collar"),
    (75, "l_uparm", 74, "l_shoulder"),
    (76, "l_lowarm", 75, "l_elbow"),
    (78, "l_wrist", 76, "l_wrist"),
    (110, "c_neck", 37, "neck"),
    (113, "c_head", 110, "head"),
];
/// From the model's axes, y up and z towards the camera, to the camera's: the tool rotates positions, and
/// leaves rotations as they are. It is its own inverse.
pub(super) const TO_CAMERA: Mat3 = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]];

/// The kept joints.
pub(super) fn hierarchy() -> JointHierarchy {
    let index = |number: usize| JOINTS.iter().position(|(of, ..)| *of == number);
    let joint = |(number, name, above, role): &KeptJoint| Joint {
        name: (*name).to_owned(),
        role: Some((*role).to_owned()),
        parent: index(*above).filter(|_| above != number),
    };
    JointHierarchy(JOINTS.iter().map(joint).collect())
}

/// The kept joints of a person in the camera's axes, of the `positions` of all of MHR's joints; `None` where the
/// file has no rotations.
pub(super) fn placed(
    root: &Part<'_>,
    positions: &[[f64; 3]],
) -> Result<Option<GlobalPose>, ImportError> {
    let Some(part) = root.find("pred_global_rots").filter(|it| !it.is_nothing()) else {
        return Ok(None);
    };
    let rotations = part.flat_rows::<9>()?;
    let mut placed = GlobalPose {
        rotations: Vec::new(),
        positions: Vec::new(),
    };
    for (number, ..) in JOINTS {
        let (Some(r), Some(position)) = (rotations.get(number), positions.get(number)) else {
            let message = format!("{} joints: MHR's skeleton has 127", rotations.len());
            return Err(part.fault("SIZE_MISMATCH", message));
        };
        let rotation = [[r[0], r[1], r[2]], [r[3], r[4], r[5]], [r[6], r[7], r[8]]];
        let rotation = exact_rotation(&rotation).ok_or_else(|| {
            part.fault(
                "NOT_A_ROTATION",
                format!("the matrix of joint {number} is not a rotation"),
            )
        })?;
        placed.rotations.push(matmul(&TO_CAMERA, &rotation));
        placed.positions.push(*position);
    }
    Ok(Some(placed))
}
