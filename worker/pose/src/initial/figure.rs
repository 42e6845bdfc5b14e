//! A stance from points in space: the torso's axes first, then the limbs bone by bone.

use crate::problem::{Observed, Problem};
use crate::rotation::{
    IDENTITY_ROTATION, from_axes, from_columns, matmul, matvec, rotation_between, slerp, transpose,
    transpose_matvec,
};
use crate::skeleton::{COUNT, REST, parent};
use yoto_capture::skeleton::Vec3;
use yoto_capture::skeleton::transform::{
    Mat3, add, cross, dot, length, normalised, rodrigues, scale, sub,
};

/// Sines of a limb's bend between which its plane gains influence on the hinge's axis: below the first it
/// has none, above the second it decides.
const HINGE: [f64; 2] = [0.15, 0.5];

/// The rotation of a body that faces the camera: its x to the picture's right, its y up, its z towards the
/// camera.
pub(crate) const FACING: Mat3 = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]];

/// Rotations of the joints from points in space. Joints without points keep the identity.
pub(super) fn rotations(problem: &Problem, observed: &Observed) -> [Mat3; COUNT] {
    let figure = &problem.markers.figure;
    let at = |point: usize| observed.space.get(point).copied();
    let pair = |[left, right]: [usize; 2]| Some([at(left)?, at(right)?]);
    let mut rotations = [IDENTITY_ROTATION; COUNT];
    let (Some(hips), Some(shoulders)) = (pair(figure.hips), pair(figure.shoulders)) else {
        rotations[0] = FACING;
        return rotations;
    };
    let up = sub(middle(shoulders), middle(hips));
    let pelvis = from_axes(sub(hips[0], hips[1]), up).unwrap_or(FACING);
    let chest = from_axes(sub(shoulders[0], shoulders[1]), up).unwrap_or(pelvis);
    let third = slerp(
        &IDENTITY_ROTATION,
        &matmul(&transpose(&pelvis), &chest),
        1.0 / 3.0,
    );
    rotations[0] = pelvis;
    for joint in [3, 6, 9] {
        rotations[joint] = third;
    }
    if let (Some(ears), Some(nose)) = (figure.ears.and_then(pair), figure.nose.and_then(at)) {
        let half = head(ears, nose)
            .map(|head| slerp(&IDENTITY_ROTATION, &matmul(&transpose(&chest), &head), 0.5));
        rotations[12] = half.unwrap_or(IDENTITY_ROTATION);
        rotations[15] = rotations[12];
    }
    for side in 0..2 {
        let sign = if side == 0 { 1.0 } else { -1.0 };
        let points = |joints: [[usize; 2]; 3]| {
            let [a, b, c] = joints.map(|joint| at(joint[side]));
            Some([a?, b?, c?])
        };
        if let Some(leg) = points([figure.hips, figure.knees, figure.ankles]) {
            let [upper, lower] = limb(&pelvis, [1, 4, 7].map(|j| j + side), leg, [1.0, 0.0, 0.0]);
            (rotations[1 + side], rotations[4 + side]) = (upper, lower);
            let shin = matmul(&matmul(&pelvis, &upper), &lower);
            if let Some(toe) = figure.toes.and_then(|toes| at(toes[side])) {
                let foot = [0.0, REST[10][1] - REST[7][1], REST[10][2] - REST[7][2]];
                let rotation = rotation_between(foot, transpose_matvec(&shin, sub(toe, leg[2])));
                rotations[7 + side] = slerp(&IDENTITY_ROTATION, &rotation, 0.5);
            }
        }
        if let Some(arm) = points([figure.shoulders, figure.elbows, figure.wrists]) {
            let joints = [16, 18, 20].map(|j| j + side);
            let [upper, lower] = limb(&chest, joints, arm, [0.0, -sign, 0.0]);
            (rotations[16 + side], rotations[18 + side]) = (upper, lower);
        }
    }
    rotations
}

fn middle([a, b]: [Vec3; 2]) -> Vec3 {
    scale(add(a, b), 0.5)
}

/// The head's axes from ears and nose.
fn head(ears: [Vec3; 2], nose: Vec3) -> Option<Mat3> {
    let across = normalised(sub(ears[0], ears[1]));
    let ahead = sub(nose, middle(ears));
    let ahead = normalised(sub(ahead, scale(across, dot(across, ahead))));
    (length(across) > 0.5 && length(ahead) > 0.5)
        .then(|| from_columns([across, cross(ahead, across), ahead]))
}

/// Rotations of a limb's two joints along its three `points`. `above` is the rotation of their parent, and
/// `hinge` is the axis of the middle joint in T-pose.
fn limb(above: &Mat3, joints: [usize; 3], points: [Vec3; 3], hinge: Vec3) -> [Mat3; 2] {
    let rest = |joint: usize| sub(REST[joint], REST[parent(joint)]);
    let [_, middle, end] = joints;
    let (first, second) = (sub(points[1], points[0]), sub(points[2], points[1]));
    let along = normalised(transpose_matvec(above, first));
    let mut upper = rotation_between(rest(middle), along);
    let axis = cross(normalised(first), normalised(second));
    let bend = length(axis);
    let share = ((bend - HINGE[0]) / (HINGE[1] - HINGE[0])).clamp(0.0, 1.0);
    if share > 0.0 {
        let (from, to) = (
            matvec(&upper, hinge),
            transpose_matvec(above, scale(axis, 1.0 / bend)),
        );
        let across = |v: Vec3| sub(v, scale(along, dot(along, v)));
        let (from, to) = (across(from), across(to));
        let angle = dot(along, cross(from, to)).atan2(dot(from, to));
        upper = matmul(&rodrigues(scale(along, share * angle)), &upper);
    }
    let whole = matmul(above, &upper);
    let lower = rotation_between(rest(end), transpose_matvec(&whole, second));
    [upper, lower]
}
