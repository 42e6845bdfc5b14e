//! Rotations, forward kinematics and bone transforms, the correction of poses.

use crate::parity::case::Case;
use crate::parity::check::{Check, GRADIENTS, VALUES};
use crate::parity::small;
use burn::optim::GradientsParams;
use yoto_avatar::motion::body::CanonicalBody;
use yoto_avatar::motion::posed::{corrected_transforms, relative_joints, transforms};
use yoto_avatar::motion::rotation::rodrigues;

#[test]
fn rotations() {
    let case = Case::read("rodrigues");
    let r = case.tensor::<2>("r", &small::device()).require_grad();
    let rotation = rodrigues(r.clone());
    let grads = case.towards("rotation", rotation.clone()).backward();
    let mut check = Check::new(&case);
    check.value("rotation", rotation);
    check.gradient("r", r.grad(&grads));
    check.within(VALUES, GRADIENTS);
}

#[test]
fn bone_transforms() {
    let case = Case::read("kinematics");
    let device = small::device();
    let body = CanonicalBody::new(case.skeleton(), &small::config(small::FOURIER), &device);
    let pose = case.pose();
    let vectors = case.tensor::<2>("vectors", &device).require_grad();
    let corrected = corrected_transforms(&body, &pose, rodrigues(vectors.clone()));
    let grads = case.towards("corrected", corrected.clone()).backward();
    let mut check = Check::new(&case);
    check.value("transforms", transforms(&body, &pose));
    check.value("joints", relative_joints(&body, &pose));
    check.value("corrected", corrected);
    check.gradient("vectors", vectors.grad(&grads));
    check.within(VALUES, GRADIENTS);
}

#[test]
fn pose_correction() {
    let case = Case::read("correction");
    let avatar = small::avatar(&small::config(small::FOURIER));
    let correction = avatar
        .correction
        .forward(case.tensor("vector", &small::device()));
    let grads = case.towards("correction", correction.clone()).backward();
    let mut check = Check::new(&case);
    check.value("correction", correction);
    check.parameters(&avatar, &GradientsParams::from_grads(grads, &avatar));
    check.within(VALUES, GRADIENTS);
}
