//! Each operation of our own against its form in Burn's tensor operations: values and
//! gradients, on points inside, at the border of and outside its box.

use burn::tensor::{Device, Tensor, TensorData};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use yoto_avatar::ops::adam::{self, AdamRates};
use yoto_avatar::ops::hash::{self, HashGrid};
use yoto_avatar::ops::warp::likelihood::{Segment, along_rays};
use yoto_avatar::ops::warp::{self, WarpGrid};

fn numbers<const D: usize>(
    rng: &mut ChaCha8Rng,
    shape: [usize; D],
    low: f32,
    high: f32,
    device: &Device,
) -> Tensor<D> {
    let values: Vec<f32> = (0..shape.iter().product())
        .map(|_| rng.random_range(low..high))
        .collect();
    Tensor::from_data(TensorData::new(values, shape), device)
}

fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.try_into_vec_as().expect("f32")
}

/// Largest difference over the largest reference magnitude.
fn relative_error(ours: &[f32], reference: &[f32]) -> f32 {
    assert_eq!(ours.len(), reference.len());
    let largest = reference.iter().fold(0f32, |m, v| m.max(v.abs()));
    assert!(largest > 0.0, "a reference of zeros proves nothing");
    ours.iter()
        .zip(reference)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f32::max)
        / largest
}

#[test]
fn warp_equals_its_reference() {
    let device = Device::flex().autodiff();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let (bones, d, n) = (5, 7, 700);
    let grid = WarpGrid {
        min: [-1.0, -0.5, -0.8],
        max: [1.0, 1.5, 0.6],
        resolution: d,
        floor: 0.0,
    };
    let weights = numbers(&mut rng, [bones + 1, d * d * d], 0.0, 0.3, &device).require_grad();
    let transforms = numbers(&mut rng, [bones, 12], -0.8, 0.8, &device).require_grad();
    let points = numbers(&mut rng, [n, 3], -1.6, 1.6, &device);
    let towards = numbers(&mut rng, [n, 4], -1.0, 1.0, &device);

    type Form = fn(Tensor<2>, Tensor<2>, Tensor<2>, &WarpGrid) -> Tensor<2>;
    let run = |form: Form| {
        let output = form(weights.clone(), transforms.clone(), points.clone(), &grid);
        let grads = (output.clone() * towards.clone()).sum().backward();
        [
            values(output),
            values(weights.grad(&grads).expect("tracked")),
            values(transforms.grad(&grads).expect("tracked")),
        ]
    };
    let (ours, reference) = (run(warp::warp), run(warp::reference::warp));
    for (part, (a, b)) in ["output", "weights", "transforms"]
        .iter()
        .zip(ours.iter().zip(&reference))
    {
        let error = relative_error(a, b);
        assert!(error < 2e-5, "{part}: {error:e}");
    }
}

#[test]
fn likelihoods_along_rays_equal_the_warps() {
    let device = Device::flex();
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let grid = WarpGrid {
        min: [-1.0; 3],
        max: [1.0; 3],
        resolution: 6,
        floor: 0.0,
    };
    // Most nodes weigh nothing, so that supports are smaller than the box.
    let weights = numbers(&mut rng, [4, 216], -2.0, 0.5, &device).clamp_min(0.0);
    let transforms = numbers(&mut rng, [3, 12], -0.8, 0.8, &device);
    let (rays, per_ray) = (200, 16);
    let mut segments = Vec::new();
    let (mut depths, mut points) = (Vec::new(), Vec::new());
    for r in 0..rays {
        let origin: [f32; 3] = std::array::from_fn(|_| rng.random_range(-2.0..2.0));
        let mut direction: [f32; 3] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
        if r % 10 == 0 {
            direction[r % 3] = 0.0;
        }
        segments.push(Segment {
            origin,
            direction,
            near: 0.0,
            far: 4.0,
        });
        for m in 0..per_ray {
            let t = (m as f32 + rng.random::<f32>()) * 4.0 / per_ray as f32;
            depths.push(t);
            points.extend((0..3).map(|a| origin[a] + t * direction[a]));
        }
    }
    let alone = along_rays(
        &values(weights.clone()),
        &values(transforms.clone()),
        &segments,
        &depths,
        &grid,
    );
    let points = Tensor::<2>::from_data(TensorData::new(points, [rays * per_ray, 3]), &device);
    let fourth: Vec<f32> = values(warp::warp(weights, transforms, points, &grid))
        .chunks_exact(4)
        .map(|row| row[3])
        .collect();
    assert!(
        fourth.contains(&0.0) && fourth.iter().any(|m| *m > 0.3),
        "points both off and on the body"
    );
    let error = relative_error(&alone, &fourth);
    assert!(error < 1e-5, "{error:e}");
}

#[test]
fn hash_encoding_equals_its_reference() {
    let device = Device::flex().autodiff();
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for features in [1, 2, 4, 8] {
        let grid = HashGrid::new(4, 3, 1.9, 7, features, [-1.0, -0.5, 0.0], 2.0);
        assert!(
            grid.levels[0].dense && !grid.levels[3].dense,
            "both kinds of level"
        );
        let table = numbers(&mut rng, [grid.rows(), features], -1.0, 1.0, &device).require_grad();
        let points = numbers(&mut rng, [500, 3], -1.2, 2.2, &device).require_grad();
        let towards = numbers(&mut rng, [500, grid.width()], -1.0, 1.0, &device);
        type Form = fn(Tensor<2>, Tensor<2>, &HashGrid) -> Tensor<2>;
        let run = |form: Form| {
            let output = form(table.clone(), points.clone(), &grid);
            let grads = (output.clone() * towards.clone()).sum().backward();
            [
                values(output),
                values(table.grad(&grads).expect("tracked")),
                values(points.grad(&grads).expect("tracked")),
            ]
        };
        let (ours, reference) = (run(hash::encode), run(hash::reference::encode));
        for (part, (a, b)) in ["output", "table", "points"]
            .iter()
            .zip(ours.iter().zip(&reference))
        {
            let error = relative_error(a, b);
            assert!(error < 2e-5, "{features} features, {part}: {error:e}");
        }
    }
}

#[test]
fn adam_equals_its_reference_and_leaves_shared_tensors_alone() {
    let device = Device::flex();
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let shape = [9000];
    let param = numbers(&mut rng, shape, -1.0, 1.0, &device);
    let grad = numbers(&mut rng, shape, -1.0, 1.0, &device);
    let (m, v) = (
        numbers(&mut rng, shape, -1.0, 1.0, &device),
        numbers(&mut rng, shape, 0.0, 1.0, &device),
    );
    let before = values(param.clone());
    let rates = AdamRates::new(1e-2, 0.9, 0.999, 1e-8, 3);
    let ours = adam::update(param.clone(), grad.clone(), m.clone(), v.clone(), rates);
    let reference = adam::reference::update(param.clone(), grad, m, v, rates);
    for (a, b) in [
        (ours.0, reference.0),
        (ours.1, reference.1),
        (ours.2, reference.2),
    ] {
        let error = relative_error(&values(a), &values(b));
        assert!(error < 1e-6, "{error:e}");
    }
    assert_eq!(
        values(param),
        before,
        "the update must not write through a shared tensor"
    );
}
