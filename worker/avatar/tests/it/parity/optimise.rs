//! The objective without LPIPS, and Adam.

use crate::parity::case::Case;
use crate::parity::check::{Check, GRADIENTS, VALUES};
use crate::parity::small;
use burn::tensor::{Device, Tensor};
use yoto_avatar::loss::{Objective, PatchObjective, Patches};
use yoto_ops::adam::{AdamRates, update};

#[test]
fn objective() {
    let case = Case::read("objective");
    let device = small::device();
    let weight = small::config(small::FOURIER).optimise.ssim_weight;
    let predicted = case.tensor::<3>("predicted", &device).require_grad();
    let side = predicted.dims()[1].isqrt();
    let objective = PatchObjective::without_lpips(weight, side, &device);
    let patches = Patches {
        predicted: predicted.clone(),
        truth: case.tensor("truth", &device),
        side,
    };
    let loss = objective.loss(patches).expect("terms");
    let grads = loss.backward();
    let mut check = Check::new(&case);
    check.value("loss", loss);
    check.gradient("predicted", predicted.grad(&grads));
    check.within(VALUES, GRADIENTS);
}

#[test]
fn adam() {
    let case = Case::read("adam");
    let device = Device::flex();
    let gradients = case.tensor::<2>("gradients", &device);
    let [updates, n] = gradients.dims();
    let mut parameter = case.tensor::<1>("parameter", &device);
    let (mut first, mut second) = (parameter.zeros_like(), parameter.zeros_like());
    for time in 1..=updates {
        let gradient: Tensor<1> = gradients.clone().slice([time - 1..time, 0..n]).reshape([n]);
        let rates = AdamRates::new(1e-2, 0.9, 0.999, 1e-8, time);
        (parameter, first, second) = update(parameter, gradient, first, second, rates);
    }
    let mut check = Check::new(&case);
    check.value("parameter", parameter);
    check.within(VALUES, GRADIENTS);
}
