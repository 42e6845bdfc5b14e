//! Encodings, the pose-conditioned code, and both networks. The reference concatenates codes and
//! skips to a layer's input; this crate multiplies them by separate weights.

use crate::parity::case::Case;
use crate::parity::check::{Check, GRADIENTS, VALUES};
use crate::parity::small;
use burn::optim::GradientsParams;
use burn::tensor::Tensor;
use yoto_avatar::avatar::AvatarAppearance;
use yoto_avatar::config::Encoding;
use yoto_avatar::field::window::hann_window;
use yoto_avatar::motion::body::CanonicalBody;
use yoto_avatar::motion::posed::relative_joints;
use yoto_ops::encode::{Bands, frequencies};
use yoto_ops::hash::{self, HashGrid, encode};

/// Bound on errors of the encodings: the rounding of angles grows with the band, to 3e-5 at the
/// highest of 10.
const BAND_VALUES: f64 = 3e-5;

#[test]
fn encodings() {
    let case = Case::read("encodings");
    let points = case.tensor::<2>("points", &small::device()).require_grad();
    let plain = frequencies(points.clone(), &Bands::new(10, 1.0));
    let pi = frequencies(points.clone(), &Bands::new(6, std::f32::consts::PI));
    let half_open = Bands {
        window: Some(hann_window(6, 3.5)),
        ..Bands::new(6, 1.0)
    };
    let windowed = frequencies(points.clone(), &half_open);
    let window: Vec<f32> = case
        .singles("openness")
        .into_iter()
        .flat_map(|a| hann_window(6, a))
        .collect();
    let objective = case.towards("plain", plain.clone())
        + case.towards("pi", pi.clone())
        + case.towards("windowed", windowed.clone());
    let grads = objective.backward();
    let mut check = Check::new(&case);
    check.value("plain", plain);
    check.value("pi", pi);
    check.value("windowed", windowed);
    check.numbers("window", &window);
    check.gradient("points", points.grad(&grads));
    check.within(BAND_VALUES, GRADIENTS);
}

#[test]
fn hash_encoding() {
    let case = Case::read("hash");
    let device = small::device();
    let grid = HashGrid::new(4, 3, 1.9, 7, 2, case.vector("low"), 2.0);
    for form in [encode, hash::reference::encode] {
        let table = case.tensor::<2>("table", &device).require_grad();
        let points = case.tensor::<2>("points", &device).require_grad();
        let encoded = form(table.clone(), points.clone(), &grid);
        let grads = case.towards("encoded", encoded.clone()).backward();
        let mut check = Check::new(&case);
        check.value("encoded", encoded);
        check.gradient("table", table.grad(&grads));
        check.gradient("points", points.grad(&grads));
        check.within(VALUES, GRADIENTS);
    }
}

#[test]
fn pose_conditioned_code() {
    let case = Case::read("condition");
    let config = small::config(small::FOURIER);
    let avatar = small::avatar(&config);
    let body = CanonicalBody::new(case.skeleton(), &config, &small::device());
    let joints = relative_joints(&body, &case.pose());
    let condition = avatar.condition.as_ref().expect("the variant has it");
    let code = condition.forward(&config.condition, avatar.codes[0].val(), joints);
    let grads = case.towards("code", code.clone()).backward();
    let mut check = Check::new(&case);
    check.value("code", code);
    check.parameters(&avatar, &GradientsParams::from_grads(grads, &avatar));
    check.within(VALUES, GRADIENTS);
}

#[test]
fn non_rigid_motion() {
    let case = Case::read("non-rigid");
    let device = small::device();
    let config = small::config(small::FOURIER);
    let avatar = small::avatar(&config);
    let points = case.tensor::<2>("points", &device).require_grad();
    let code = case.tensor::<1>("code", &device).require_grad();
    let moved = avatar.non_rigid.forward(
        &config,
        points.clone(),
        case.tensor("vector", &device),
        Some(code.clone()),
        small::PROGRESS,
    );
    let grads = case.towards("moved", moved.clone()).backward();
    let mut check = Check::new(&case);
    check.value("moved", moved);
    check.gradient("points", points.grad(&grads));
    check.gradient("code", code.grad(&grads));
    check.parameters(&avatar, &GradientsParams::from_grads(grads, &avatar));
    check.within(VALUES, GRADIENTS);
}

#[test]
fn canonical_field() {
    for (name, encoding) in [
        ("canonical-fourier", small::FOURIER),
        ("canonical-hash", small::HASH),
    ] {
        canonical(Case::read(name), encoding);
    }
}

fn canonical(case: Case, encoding: Encoding) {
    let device = small::device();
    let config = small::config(encoding);
    let avatar = small::avatar(&config);
    let body = CanonicalBody::new(case.skeleton(), &config, &device);
    let points = case.tensor::<2>("points", &device).require_grad();
    let code: Tensor<1> = case.tensor("code", &device).require_grad();
    let AvatarAppearance::Field(field) = avatar.appearance(&config) else {
        panic!("the tier has a field");
    };
    let values = field.canonical.forward(
        &field.config.canonical,
        points.clone(),
        1,
        body.hash.as_ref(),
        Some(code.clone()),
    );
    let objective =
        case.towards("rgb", values.rgb.clone()) + case.towards("density", values.density.clone());
    let grads = objective.backward();
    let mut check = Check::new(&case);
    check.value("rgb", values.rgb);
    check.value("density", values.density);
    check.gradient("points", points.grad(&grads));
    check.gradient("code", code.grad(&grads));
    check.parameters(&avatar, &GradientsParams::from_grads(grads, &avatar));
    check.within(VALUES, GRADIENTS);
}
