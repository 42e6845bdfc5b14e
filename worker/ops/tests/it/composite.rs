use crate::{numbers, relative_error, values};
use burn::tensor::{Device, Tensor, TensorData};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use yoto_ops::composite::{self, RaySamples};

/// 300 rays of 0 to 12 samples.
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
        subsampling: None,
    }
}

/// Colours, densities and likelihoods for `samples`; some samples are opaque or have no density.
fn field_values(
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
        let (rgb, density, likelihood) = field_values(&mut rng, &samples, &device);
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
    let (rgb, density, likelihood) = field_values(&mut rng, &whole, &device);
    let look = |samples: &RaySamples| {
        composite::composite(rgb.clone(), density.clone(), likelihood.clone(), samples)
    };
    let all = values(look(&whole));
    for bound in [1e-3, 1e-2] {
        let samples = RaySamples {
            min_transmittance: bound,
            subsampling: None,
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
    let (rgb, density, likelihood) = field_values(&mut rng, &samples, &device);
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
            // By definition, every later sample loses the share of the light that this one takes.
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

#[test]
#[should_panic(expected = "samples of rays")]
fn values_for_fewer_samples_than_the_rays_have_are_refused() {
    let device = Device::flex();
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let samples = ray_samples(&mut rng, 0.0);
    let n = samples.steps.len();
    let rgb = numbers(&mut rng, [n, 3], 0.0, 1.0, &device);
    let density = numbers(&mut rng, [n - 1], 0.0, 1.0, &device);
    let likelihood = numbers(&mut rng, [n], 0.0, 1.0, &device);
    composite::composite(rgb, density, likelihood, &samples);
}
