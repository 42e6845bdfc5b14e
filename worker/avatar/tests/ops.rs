//! Each operation of our own against its form in Burn's tensor operations: values and
//! gradients, on points inside, at the border of and outside its box.

use burn::tensor::{Device, Tensor, TensorData};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use yoto_avatar::ops::adam::{self, AdamRates};
use yoto_avatar::ops::composite::{self, RaySamples};
use yoto_avatar::ops::form::Form;
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
fn points_along_rays_equal_the_warps() {
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
    let warped = values(warp::warp(weights, transforms, points, &grid));
    assert!(
        warped.contains(&0.0) && warped.chunks_exact(4).any(|row| row[3] > 0.3),
        "points both off and on the body"
    );
    let column = |values: &[f32], c: usize| -> Vec<f32> {
        values.iter().skip(c).step_by(4).copied().collect()
    };
    let alone = alone.concat();
    // A mean by next to no weight is that weight's rounding.
    for (c, bound) in [(0, 2e-4), (1, 2e-4), (2, 2e-4), (3, 1e-5)] {
        let error = relative_error(&column(&alone, c), &column(&warped, c));
        assert!(error < bound, "column {c}: {error:e}");
    }
}

/// A grid with dense and hashed levels.
fn hash_grid(features: usize) -> HashGrid {
    let grid = HashGrid::new(4, 3, 1.9, 7, features, [-1.0, -0.5, 0.0], 2.0);
    assert!(
        grid.levels[0].dense && !grid.levels[3].dense,
        "both kinds of level"
    );
    grid
}

/// More than a task's, and no multiple of anything.
const HASH_POINTS: usize = 1237;

#[test]
fn hash_encoding_equals_its_reference_in_every_form() {
    let device = Device::flex().autodiff();
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for features in [1, 2, 4, 8, 16] {
        let grid = hash_grid(features);
        let n = HASH_POINTS;
        let table = numbers(&mut rng, [grid.rows(), features], -1.0, 1.0, &device).require_grad();
        let points = numbers(&mut rng, [n, 3], -1.2, 2.2, &device).require_grad();
        let mut towards = values(numbers(&mut rng, [n, grid.width()], -1.0, 1.0, &device));
        // Points without a gradient, one here and there and many in a row.
        for (at, row) in towards.chunks_exact_mut(grid.width()).enumerate() {
            if at % 7 == 3 || (400..1000).contains(&at) {
                row.fill(0.0);
            }
        }
        let weights = TensorData::new(towards.clone(), [n, grid.width()]);
        let weights = Tensor::<2>::from_data(weights, &device);
        type Encode = fn(Tensor<2>, Tensor<2>, &HashGrid) -> Tensor<2>;
        let run = |form: Encode| {
            let output = form(table.clone(), points.clone(), &grid);
            let grads = (output.clone() * weights.clone()).sum().backward();
            [
                values(output),
                values(table.grad(&grads).expect("tracked")),
                values(points.grad(&grads).expect("tracked")),
            ]
        };
        let reference = run(hash::reference::encode);
        let mut forms = vec![("tracked", run(hash::encode))];
        let (table, points) = (values(table.clone()), values(points.clone()));
        for form in Form::of_loops() {
            let output = hash::cpu::forward_in(form, &table, &points, &grid);
            let (to_table, to_points) =
                hash::cpu::backward_in(form, &table, &points, &towards, &grid, true);
            let alone = hash::cpu::backward_in(form, &table, &points, &towards, &grid, false);
            assert!(alone.0 == to_table && alone.1.is_empty());
            forms.push((form.name(), [output, to_table, to_points]));
        }
        for (form, ours) in forms {
            for (part, (a, b)) in ["output", "table", "points"]
                .iter()
                .zip(ours.iter().zip(&reference))
            {
                let error = relative_error(a, b);
                assert!(
                    error < 2e-5,
                    "{features} features, {form}, {part}: {error:e}"
                );
            }
        }
    }
}

#[test]
fn gradients_of_the_hash_grid_hang_on_no_number_of_threads() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let grid = hash_grid(2);
    let mut draw =
        |count: usize| -> Vec<f32> { (0..count).map(|_| rng.random_range(-1.0..1.0)).collect() };
    let table = draw(2 * grid.rows());
    let points = draw(3 * HASH_POINTS);
    let grad = draw(grid.width() * HASH_POINTS);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let back = || hash::cpu::backward(&table, &points, &grad, &grid, true);
        let forward = || hash::cpu::forward(&table, &points, &grid);
        pool.expect("threads").install(|| (forward(), back()))
    };
    let one = with(1);
    for threads in [2, 3, 8] {
        assert!(one == with(threads), "{threads} threads");
    }
}

#[test]
fn points_that_are_no_numbers_stay_inside_the_table() {
    let grid = hash_grid(2);
    let table = vec![1.0; 2 * grid.rows()];
    let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -0.0];
    let points: Vec<f32> = (0..odd.len().pow(3))
        .flat_map(|i| [odd[i % 5], odd[i / 5 % 5], odd[i / 25]])
        .collect();
    let grad = vec![1.0; points.len() / 3 * grid.width()];
    for form in Form::of_loops() {
        let output = hash::cpu::forward_in(form, &table, &points, &grid);
        let (to_table, _) = hash::cpu::backward_in(form, &table, &points, &grad, &grid, true);
        for (point, row) in points
            .chunks_exact(3)
            .zip(output.chunks_exact(grid.width()))
        {
            let sound = point.iter().all(|x| !x.is_nan());
            assert!(
                !sound || row.iter().all(|v| (v - 1.0).abs() < 1e-5),
                "{point:?}"
            );
        }
        assert_eq!(to_table.len(), table.len());
    }
}

#[test]
#[should_panic(expected = "rows don't hold its nodes")]
fn a_grid_whose_levels_do_not_fit_is_refused() {
    let mut grid = hash_grid(2);
    let table = vec![0.0; 2 * grid.rows()];
    grid.levels[0].cells += 1;
    hash::cpu::forward(&table, &[0.0; 3], &grid);
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

/// Some hundred rays of 0 to 12 samples, a few of them opaque or of no density.
fn ray_samples(rng: &mut ChaCha8Rng, min_transmittance: f32) -> RaySamples {
    let mut starts = vec![0usize];
    for ray in 0..300 {
        starts.push(starts[ray] + rng.random_range(0..13));
    }
    let n = starts[300];
    RaySamples {
        starts: starts.into(),
        steps: (0..n).map(|_| rng.random_range(0.01..0.1)).collect(),
        depths: (0..n).map(|_| rng.random_range(1.0..4.0)).collect(),
        min_transmittance,
        thinning: None,
    }
}

/// Colours, densities and likelihoods for `samples`.
fn seen_values(
    rng: &mut ChaCha8Rng,
    samples: &RaySamples,
    device: &Device,
) -> (Tensor<2>, Tensor<1>, Tensor<1>) {
    let n = samples.steps.len();
    let rgb = numbers(rng, [n, 3], 0.0, 1.0, device).require_grad();
    let density: Vec<f32> = (0..n)
        .map(|i| match i % 17 {
            0 => 0.0,
            1 => 1e6,
            _ => rng.random_range(0.0..40.0),
        })
        .collect();
    let density = Tensor::from_data(TensorData::new(density, [n]), device).require_grad();
    let likelihood = numbers(rng, [n], 0.2, 1.0, device).require_grad();
    (rgb, density, likelihood)
}

#[test]
fn compositing_equals_its_reference_stopped_or_not() {
    let device = Device::flex().autodiff();
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    for min_transmittance in [0.0, 1e-3, 0.1] {
        let samples = ray_samples(&mut rng, min_transmittance);
        let (rgb, density, likelihood) = seen_values(&mut rng, &samples, &device);
        let towards = numbers(&mut rng, [samples.rays(), 5], -1.0, 1.0, &device);
        type Form = fn(Tensor<2>, Tensor<1>, Tensor<1>, &RaySamples) -> Tensor<2>;
        let run = |form: Form| {
            let output = form(rgb.clone(), density.clone(), likelihood.clone(), &samples);
            let grads = (output.clone() * towards.clone()).sum().backward();
            [
                values(output),
                values(rgb.grad(&grads).expect("tracked")),
                values(density.grad(&grads).expect("tracked")),
                values(likelihood.grad(&grads).expect("tracked")),
            ]
        };
        let (ours, reference) = (
            run(composite::composite),
            run(composite::reference::composite),
        );
        for (part, (a, b)) in ["output", "rgb", "density", "likelihood"]
            .iter()
            .zip(ours.iter().zip(&reference))
        {
            let error = relative_error(a, b);
            assert!(error < 2e-6, "{min_transmittance}, {part}: {error:e}");
        }
        let zeros = |v: &[f32]| v.iter().filter(|v| **v == 0.0).count();
        assert_eq!(
            zeros(&ours[1]),
            zeros(&reference[1]),
            "the same samples are behind the bound"
        );
    }
}

#[test]
fn an_early_stop_costs_at_most_its_bound_and_leaves_exact_zeros() {
    let device = Device::flex().autodiff();
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let whole = ray_samples(&mut rng, 0.0);
    let (rgb, density, likelihood) = seen_values(&mut rng, &whole, &device);
    let look = |samples: &RaySamples| {
        composite::composite(rgb.clone(), density.clone(), likelihood.clone(), samples)
    };
    let all = values(look(&whole));
    for bound in [1e-3, 1e-2] {
        let samples = RaySamples {
            min_transmittance: bound,
            thinning: None,
            ..whole.clone()
        };
        let stopped = look(&samples);
        let grads = stopped.clone().sum().backward();
        for (i, (a, b)) in values(stopped).iter().zip(&all).enumerate() {
            // Depths reach 4 m.
            let scale = if i % 5 == 4 { 4.0 } else { 1.0 };
            assert!((a - b).abs() <= scale * bound + 1e-6, "{a} {b}");
        }
        let (sigma, m) = (values(density.clone()), values(likelihood.clone()));
        let to_density = values(density.grad(&grads).expect("tracked"));
        let to_likelihood = values(likelihood.grad(&grads).expect("tracked"));
        let to_rgb = values(rgb.grad(&grads).expect("tracked"));
        let mut behind = 0;
        for pair in samples.starts.windows(2) {
            let mut clear = 1f64;
            for i in pair[0]..pair[1] {
                // Well under the bound, whatever the rounding.
                if clear < 0.99 * f64::from(bound) {
                    behind += 1;
                    assert!(
                        to_density[i] == 0.0
                            && to_likelihood[i] == 0.0
                            && to_rgb[3 * i..3 * i + 3] == [0.0; 3],
                        "sample {i} is behind the bound"
                    );
                }
                let left = (-f64::from(sigma[i]) * f64::from(samples.steps[i])).exp();
                clear *= 1.0 - (1.0 - left) * f64::from(m[i]) + 1e-10;
            }
        }
        assert!(behind > 10, "only {behind} samples behind the bound");
    }
}

#[test]
fn compositings_gradients_equal_those_in_double_precision() {
    let device = Device::flex().autodiff();
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let samples = ray_samples(&mut rng, 0.0);
    let (rgb, density, likelihood) = seen_values(&mut rng, &samples, &device);
    let towards = numbers(&mut rng, [samples.rays(), 5], -1.0, 1.0, &device);
    let output = composite::composite(rgb.clone(), density.clone(), likelihood.clone(), &samples);
    let grads = (output * towards.clone()).sum().backward();
    let ours = [
        values(density.grad(&grads).expect("tracked")),
        values(likelihood.grad(&grads).expect("tracked")),
    ];
    let [c, sigma, m, g] = [
        values(rgb),
        values(density),
        values(likelihood),
        values(towards),
    ]
    .map(|v| v.into_iter().map(f64::from).collect::<Vec<_>>());
    let mut exact = [vec![0f32; sigma.len()], vec![0f32; sigma.len()]];
    for (ray, pair) in samples.starts.windows(2).enumerate() {
        let value = |i: usize| {
            let colour: f64 = (0..3).map(|a| g[5 * ray + a] * c[3 * i + a]).sum();
            colour + g[5 * ray + 3] + g[5 * ray + 4] * f64::from(samples.depths[i])
        };
        for i in pair[0]..pair[1] {
            let left = |i: usize| (-sigma[i] * f64::from(samples.steps[i])).exp();
            let alpha = |i: usize| (1.0 - left(i)) * m[i];
            let through = |i: usize| 1.0 - alpha(i) + 1e-10;
            let clear: f64 = (pair[0]..i).map(through).product();
            // From the definition: every later sample loses what this one takes.
            let later: f64 = (i + 1..pair[1])
                .map(|j| (i + 1..j).map(through).product::<f64>() * alpha(j) * value(j))
                .sum();
            let to_alpha = clear * (value(i) - later);
            exact[0][i] = (to_alpha * m[i] * f64::from(samples.steps[i]) * left(i)) as f32;
            exact[1][i] = (to_alpha * (1.0 - left(i))) as f32;
        }
    }
    for (ours, exact) in ours.iter().zip(&exact) {
        let error = relative_error(ours, exact);
        assert!(error < 2e-6, "{error:e}");
    }
}
