use crate::{numbers, relative_error, values};
use burn::tensor::{Device, Tensor, TensorData};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use yoto_ops::warp::likelihood::{Segment, along_rays};
use yoto_ops::warp::{self, WarpGrid};

#[test]
fn warp_equals_its_reference() {
    let device = Device::flex().autodiff();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let (bones, nodes, n) = (5, [7, 6, 9], 700);
    let grid = WarpGrid {
        min: [-1.0, -0.5, -0.8],
        max: [1.0, 1.5, 0.6],
        nodes,
        floor: 0.0,
    };
    let weights = numbers(&mut rng, [bones + 1, 7 * 6 * 9], 0.0, 0.3, &device).require_grad();
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
fn points_along_rays_equal_the_warps() {
    let device = Device::flex();
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let grid = WarpGrid {
        min: [-1.0; 3],
        max: [1.0; 3],
        nodes: [6; 3],
        floor: 0.0,
    };
    // Most weights are 0, so that supports are smaller than the box.
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
        |_, warped| warped.to_vec(),
    )
    .concat();
    let points = Tensor::<2>::from_data(TensorData::new(points, [rays * per_ray, 3]), &device);
    let warped = values(warp::warp(weights, transforms, points, &grid));
    assert!(
        warped.contains(&0.0) && warped.chunks_exact(4).any(|row| row[3] > 0.3),
        "points both off and on the body"
    );
    let column = |values: &[f32], c: usize| -> Vec<f32> {
        values.iter().skip(c).step_by(4).copied().collect()
    };
    let alone = alone.concat();
    // A mean whose weights are close to 0 has a large relative rounding error.
    for (c, bound) in [(0, 2e-4), (1, 2e-4), (2, 2e-4), (3, 1e-5)] {
        let error = relative_error(&column(&alone, c), &column(&warped, c));
        assert!(error < bound, "column {c}: {error:e}");
    }
}

#[test]
#[should_panic(expected = "weights: 27 for each of 2 bones")]
fn a_bone_without_weights_is_refused() {
    let grid = WarpGrid {
        min: [0.0; 3],
        max: [1.0; 3],
        nodes: [3; 3],
        floor: 0.0,
    };
    warp::cpu::forward(&[0.5; 27], &[0.0; 24], &[0.0; 3], &grid);
}
