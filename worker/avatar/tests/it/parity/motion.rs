//! The prior of the motion weights, their volume, and the warp.

use crate::parity::case::Case;
use crate::parity::check::{Check, GRADIENTS, VALUES};
use crate::parity::small;
use burn::optim::GradientsParams;
use yoto_avatar::config::MotionForm;
use yoto_avatar::motion::body::CanonicalBody;
use yoto_avatar::motion::prior::{canonical_grid, prior};
use yoto_ops::warp::{WarpGrid, reference, warp};

/// Nodes per axis in the prior's case.
const PRIOR_RESOLUTION: usize = 13;

#[test]
fn prior_volume() {
    let case = Case::read("prior");
    let skeleton = case.skeleton();
    let grid = canonical_grid(&skeleton, [PRIOR_RESOLUTION; 3], 0.0);
    let mut check = Check::new(&case);
    check.numbers("prior", &prior(&skeleton, &grid));
    check.within(VALUES, GRADIENTS);
}

#[test]
fn weight_volume() {
    let case = Case::read("volume");
    let config = small::config(small::FOURIER);
    let avatar = small::avatar(&config);
    let body = CanonicalBody::new(case.skeleton(), &config, &small::device());
    let volume = avatar.motion.volume(1, body.log_prior.clone());
    let grads = case.towards("volume", volume.clone()).backward();
    let mut check = Check::new(&case);
    check.value("log_prior", body.log_prior);
    check.value("volume", volume);
    check.parameters(&avatar, &GradientsParams::from_grads(grads, &avatar));
    check.within(VALUES, GRADIENTS);
}

#[test]
fn weight_volume_of_the_decoder() {
    let case = Case::read("volume-deconv");
    let mut config = small::config(small::FOURIER);
    config.motion.resolution = 8.into();
    config.motion.form = MotionForm::Deconv {
        embedding: 4,
        hidden: 8,
        channels: vec![6, 5],
    };
    let avatar = small::avatar_with(&config, "model-deconv");
    let body = CanonicalBody::new(case.skeleton(), &config, &small::device());
    let volume = avatar.motion.volume(1, body.log_prior);
    let grads = case.towards("volume", volume.clone()).backward();
    let mut check = Check::new(&case);
    check.value("volume", volume);
    check.parameters(&avatar, &GradientsParams::from_grads(grads, &avatar));
    check.within(VALUES, GRADIENTS);
}

#[test]
fn warped_points() {
    let case = Case::read("warp");
    let device = small::device();
    let grid = WarpGrid {
        min: case.vector("low"),
        max: case.vector("high"),
        nodes: [7; 3],
        floor: 0.0,
    };
    for form in [warp, reference::warp] {
        let weights = case.tensor::<2>("weights", &device).require_grad();
        let transforms = case.tensor::<2>("transforms", &device).require_grad();
        let points = case.tensor::<2>("points", &device);
        let [n, _] = points.dims();
        let output = form(weights.clone(), transforms.clone(), points, &grid);
        let canonical = output.clone().slice([0..n, 0..3]);
        let likelihood = output.slice([0..n, 3..4]).reshape([n]);
        let objective = case.towards("canonical", canonical.clone())
            + case.towards("likelihood", likelihood.clone());
        let grads = objective.backward();
        let mut check = Check::new(&case);
        check.value("canonical", canonical);
        check.value("likelihood", likelihood);
        check.gradient("weights", weights.grad(&grads));
        check.gradient("transforms", transforms.grad(&grads));
        check.within(VALUES, GRADIENTS);
    }
}
