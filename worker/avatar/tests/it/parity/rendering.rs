//! Compositing, with opaque samples, empty rays and samples with a likelihood of 0.

use crate::parity::case::Case;
use crate::parity::check::{Check, GRADIENTS, VALUES};
use crate::parity::small;
use yoto_avatar::render::composite::composite;
use yoto_avatar::render::samples::Samples;

/// Samples per ray in the case.
const PER_RAY: usize = 8;

#[test]
fn compositing() {
    let case = Case::read("composite");
    let device = small::device();
    let samples = Samples {
        rays: case.shape("expected.alpha")[0],
        per_ray: PER_RAY,
        steps: case.singles("steps"),
        depths: case.singles("depths"),
        places: case.numbers("places").iter().map(|p| *p as i64).collect(),
        // Compositing does not use the positions of samples.
        ..Samples::default()
    };
    let rgb = case.tensor::<2>("rgb", &device).require_grad();
    let density = case.tensor::<1>("density", &device).require_grad();
    let likelihood = case.tensor::<1>("likelihood", &device).require_grad();
    let seen = composite(
        &samples,
        0.0,
        None,
        rgb.clone(),
        density.clone(),
        likelihood.clone(),
    );
    let objective = case.towards("rgb", seen.rgb.clone())
        + case.towards("alpha", seen.alpha.clone())
        + case.towards("depth", seen.depth.clone());
    let grads = objective.backward();
    let mut check = Check::new(&case);
    check.value("rgb", seen.rgb);
    check.value("alpha", seen.alpha);
    check.value("depth", seen.depth);
    check.gradient("rgb", rgb.grad(&grads));
    check.gradient("density", density.grad(&grads));
    check.gradient("likelihood", likelihood.grad(&grads));
    check.within(VALUES, GRADIENTS);
}
