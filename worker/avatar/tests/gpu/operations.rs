//! Each operation's `cube` form against its reference on the CPU, values and gradients: on
//! points inside, at the border of and outside its box, and where gradients are exactly zero.

use crate::compare::{Numbers, assert_close, values};
use crate::device::on_vulkan;
use burn::tensor::{Device, Tensor};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f32::consts::PI;
use yoto_ops::adam::{self, AdamRates};
use yoto_ops::composite::{self, RaySamples};
use yoto_ops::encode::{self, Bands};
use yoto_ops::hash::{self, HashGrid};
use yoto_ops::warp::{self, WarpGrid};

/// Seconds an operation may take: a software driver compiles its kernels first.
const LIMIT: u64 = 120;
/// Largest error over the largest magnitude, of f32 sums in another order.
const BOUND: f32 = 2e-5;

/// Sets rows `from..` of gradients to exactly zero.
fn zeroed(width: usize, from: usize) -> impl FnOnce(&mut [f32]) {
    move |values| values[width * from..].fill(0.0)
}

#[test]
fn warp_equals_its_reference_and_leaves_out_what_the_cpu_does() {
    on_vulkan(LIMIT, |vulkan| {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        // More points than one group of threads sums over, and an odd number of groups.
        let (bones, nodes, n) = (5, [7, 6, 9], 2_300);
        let grid = WarpGrid {
            min: [-1.0, -0.5, -0.8],
            max: [1.0, 1.5, 0.6],
            nodes,
            floor: 0.0,
        };
        let voxels = 7 * 6 * 9;
        let weights = Numbers::drawn(&mut rng, [bones + 1, voxels], 0.0, 0.3);
        let sparse = weights.clone().with(|values| {
            // A bone without weights, and one with weights in a corner only.
            values[voxels..2 * voxels].fill(0.0);
            values[2 * voxels + 40..3 * voxels].fill(0.0);
        });
        let transforms = Numbers::drawn(&mut rng, [bones, 12], -0.8, 0.8);
        let points = Numbers::drawn(&mut rng, [n, 3], -1.6, 1.6);
        let towards = Numbers::drawn(&mut rng, [n, 4], -1.0, 1.0).with(zeroed(4, 2_000));

        type Form = fn(Tensor<2>, Tensor<2>, Tensor<2>, &WarpGrid) -> Tensor<2>;
        let run = |device: Device, weights: &Numbers<2>, form: Form| {
            let device = device.autodiff();
            let (weights, transforms) =
                (weights.learned_on(&device), transforms.learned_on(&device));
            let output = form(
                weights.clone(),
                transforms.clone(),
                points.on(&device),
                &grid,
            );
            let grads = (output.clone() * towards.on(&device)).sum().backward();
            [
                values(output),
                values(weights.grad(&grads).expect("tracked")),
                values(transforms.grad(&grads).expect("tracked")),
            ]
        };
        // Where a bone has no weights, the reference has gradients to them and the other forms have
        // none: there the GPU is compared with the CPU.
        let cpu = Device::flex();
        for (weights, expected) in [
            (&weights, run(cpu.clone(), &weights, warp::reference::warp)),
            (&sparse, run(cpu, &sparse, warp::warp)),
        ] {
            assert_close(
                &["output", "weights", "transforms"],
                &run(vulkan.clone(), weights, warp::warp),
                &expected,
                BOUND,
            );
        }
    });
}

#[test]
fn hash_encoding_equals_its_reference() {
    on_vulkan(LIMIT, |vulkan| {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for features in [1, 2, 4, 8] {
            let grid = HashGrid::new(4, 3, 1.9, 7, features, [-1.0, -0.5, 0.0], 2.0);
            assert!(
                grid.levels[0].dense && !grid.levels[3].dense,
                "both kinds of level"
            );
            let table = Numbers::drawn(&mut rng, [grid.rows(), features], -1.0, 1.0);
            let points = Numbers::drawn(&mut rng, [700, 3], -1.2, 2.2);
            let towards = Numbers::drawn(&mut rng, [700, grid.width()], -1.0, 1.0)
                .with(zeroed(grid.width(), 500));

            type Form = fn(Tensor<2>, Tensor<2>, &HashGrid) -> Tensor<2>;
            let run = |device: Device, form: Form| {
                let device = device.autodiff();
                let (table, points) = (table.learned_on(&device), points.learned_on(&device));
                let output = form(table.clone(), points.clone(), &grid);
                let grads = (output.clone() * towards.on(&device)).sum().backward();
                [
                    values(output),
                    values(table.grad(&grads).expect("tracked")),
                    values(points.grad(&grads).expect("tracked")),
                ]
            };
            let reference = run(Device::flex(), hash::reference::encode);
            assert_close(
                &["output", "table", "points"],
                &run(vulkan.clone(), hash::encode),
                &reference,
                BOUND,
            );
            // Constant points get no gradient at all.
            let device = vulkan.clone().autodiff();
            let table = table.learned_on(&device);
            let output = hash::encode(table.clone(), points.on(&device), &grid);
            let grads = (output * towards.on(&device)).sum().backward();
            assert_close(
                &["table alone"],
                &[values(table.grad(&grads).expect("tracked"))],
                &reference[1..2],
                BOUND,
            );
        }
    });
}

/// Rays of 0 to 20 samples, some of them opaque.
fn rays(rng: &mut ChaCha8Rng, count: usize, min_transmittance: f32) -> RaySamples {
    let mut starts = vec![0];
    for _ in 0..count {
        starts.push(starts[starts.len() - 1] + rng.random_range(0..20usize));
    }
    let n = starts[count];
    RaySamples {
        starts: starts.into(),
        steps: (0..n).map(|_| rng.random_range(0.01..0.2)).collect(),
        depths: (0..n).map(|i| 1.0 + 0.1 * i as f32).collect(),
        min_transmittance,
        subsampling: None,
    }
}

#[test]
fn compositing_equals_its_reference() {
    on_vulkan(LIMIT, |vulkan| {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        for min_transmittance in [0.0, 0.05] {
            let samples = rays(&mut rng, 300, min_transmittance);
            let n = samples.steps.len();
            let rgb = Numbers::drawn(&mut rng, [n, 3], 0.0, 1.0);
            let density = Numbers::drawn(&mut rng, [n], 0.0, 8.0)
                .with(|values| values.iter_mut().step_by(37).for_each(|v| *v = 1e6));
            let likelihood = Numbers::drawn(&mut rng, [n], 0.5, 1.0)
                .with(|values| values.iter_mut().step_by(37).for_each(|v| *v = 1.0));
            let towards = Numbers::drawn(&mut rng, [300, 5], -1.0, 1.0);

            type Form = fn(Tensor<2>, Tensor<1>, Tensor<1>, &RaySamples) -> Tensor<2>;
            let run = |device: Device, form: Form| {
                let device = device.autodiff();
                let (rgb, density, likelihood) = (
                    rgb.learned_on(&device),
                    density.learned_on(&device),
                    likelihood.learned_on(&device),
                );
                let output = form(rgb.clone(), density.clone(), likelihood.clone(), &samples);
                let grads = (output.clone() * towards.on(&device)).sum().backward();
                [
                    values(output),
                    values(rgb.grad(&grads).expect("tracked")),
                    values(density.grad(&grads).expect("tracked")),
                    values(likelihood.grad(&grads).expect("tracked")),
                ]
            };
            let ours = run(vulkan.clone(), composite::composite);
            let reference = run(Device::flex(), composite::reference::composite);
            let parts = ["output", "rgb", "density", "likelihood"];
            assert_close(&parts, &ours, &reference, BOUND);
            if min_transmittance > 0.0 {
                // The networks' backward passes must leave out the same samples. Without a bound
                // there may be other zeros: a GPU may flush the smallest numbers to 0.
                let zeros = |to_rgb: &[f32]| to_rgb.iter().filter(|g| **g == 0.0).count();
                assert_eq!(zeros(&ours[1]), zeros(&reference[1]));
                assert!(zeros(&ours[1]) > 0);
            }
        }
    });
}

#[test]
fn adam_equals_its_reference_and_leaves_shared_tensors_alone() {
    on_vulkan(LIMIT, |vulkan| {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let shape = [90, 101];
        let param = Numbers::drawn(&mut rng, shape, -1.0, 1.0);
        let grad = Numbers::drawn(&mut rng, shape, -1.0, 1.0);
        let moment_1 = Numbers::drawn(&mut rng, shape, -1.0, 1.0);
        let moment_2 = Numbers::drawn(&mut rng, shape, 0.0, 1.0);
        let rates = AdamRates::new(1e-2, 0.9, 0.999, 1e-8, 3);

        let shared = param.on(&vulkan);
        let ours = adam::update(
            shared.clone(),
            grad.on(&vulkan),
            moment_1.on(&vulkan),
            moment_2.on(&vulkan),
            rates,
        );
        let cpu = Device::flex();
        let reference = adam::reference::update(
            param.on(&cpu),
            grad.on(&cpu),
            moment_1.on(&cpu),
            moment_2.on(&cpu),
            rates,
        );
        assert_close(
            &["parameter", "first moment", "second moment"],
            &[values(ours.0), values(ours.1), values(ours.2)],
            &[
                values(reference.0),
                values(reference.1),
                values(reference.2),
            ],
            1e-6,
        );
        assert_eq!(
            values(shared),
            values(param.on(&cpu)),
            "the update must not write through a shared tensor"
        );
    });
}

#[test]
fn no_points_or_samples_have_no_results() {
    on_vulkan(LIMIT, |vulkan| {
        let grid = WarpGrid {
            min: [0.0; 3],
            max: [1.0; 3],
            nodes: [3; 3],
            floor: 0.0,
        };
        let none = Tensor::<2>::zeros([0, 3], &vulkan);
        let weights = Tensor::ones([1, 27], &vulkan);
        let transforms = Tensor::ones([1, 12], &vulkan);
        let warped = warp::warp(weights, transforms, none.clone(), &grid);
        assert_eq!(warped.dims(), [0, 4]);
        assert!(values(warped).is_empty());

        let grid = HashGrid::new(2, 3, 1.9, 7, 2, [0.0; 3], 1.0);
        let table = Tensor::ones([grid.rows(), 2], &vulkan);
        let features = hash::encode(table, none.clone(), &grid);
        assert_eq!(features.dims(), [0, 4]);
        assert!(values(features).is_empty());

        let encoded = encode::frequencies(none.clone(), &Bands::new(2, 1.0));
        assert_eq!(encoded.dims(), [0, 12]);
        assert!(values(encoded).is_empty());

        // Three rays without samples.
        let samples = RaySamples {
            starts: vec![0; 4].into(),
            steps: Vec::new().into(),
            depths: Vec::new().into(),
            min_transmittance: 0.0,
            subsampling: None,
        };
        let line = Tensor::<1>::zeros([0], &vulkan);
        let seen = composite::composite(none, line.clone(), line, &samples);
        assert_eq!(values(seen), [0.0; 15]);
    });
}

#[test]
fn encoding_equals_its_reference_with_any_precision_of_the_drivers_sines() {
    on_vulkan(LIMIT, |vulkan| {
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let points = Numbers::drawn(&mut rng, [700, 3], -1.5, 1.5);
        let windowed = Bands {
            window: Some(vec![1.0, 0.3]),
            ..Bands::new(3, 1.0)
        };
        // Angles of up to 2,400 radians.
        for bands in [Bands::new(1, PI), windowed, Bands::new(10, PI)] {
            let towards = Numbers::drawn(&mut rng, [700, 6 * bands.count], -1.0, 1.0);
            type Form = fn(Tensor<2>, &Bands) -> Tensor<2>;
            let run = |device: Device, form: Form| {
                let device = device.autodiff();
                let points = points.learned_on(&device);
                let output = form(points.clone(), &bands);
                let grads = (output.clone() * towards.on(&device)).sum().backward();
                [
                    values(output),
                    values(points.grad(&grads).expect("tracked")),
                ]
            };
            assert_close(
                &["output", "points"],
                &run(vulkan.clone(), encode::frequencies),
                &run(Device::flex(), encode::reference::frequencies),
                1e-6,
            );
        }
    });
}
