//! The network operation in each form that this machine can run, against f64 arithmetic and against
//! Burn's own operations, at sizes that fill no tile or panel.
//!
//! `cargo test -p yoto-avatar --test it mlp:: -- --nocapture` prints the errors.

mod exact;
mod networks;

use burn::tensor::{Device, Tensor, TensorData};
use exact::exact;
use networks::{case, frequencies, plan, plans};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use yoto_avatar::config::Precision;
use yoto_ops::form::Form;
use yoto_ops::mlp::cpu::{backward, forward};
use yoto_ops::mlp::{self, MlpPlan};

/// Row counts: one, less than a tile's step, around a power of two, several tiles.
const SIZES: [usize; 5] = [1, 7, 127, 129, 1000];
/// Bound on errors of f32 results, relative to the largest magnitude.
const VALUES: f64 = 2e-6;
/// Bound on errors of f32 gradients, relative to the largest magnitude.
const GRADIENTS: f64 = 1e-5;
/// Largest error of a bf16 result or gradient over the largest magnitude, against f64 with the same
/// roundings. A sum of f32 and one of f64 may round to different neighbours, and a unit may be
/// active in one and not in the other.
const ROUNDED: f64 = 2e-2;
/// Largest loss of cosine: between bf16 gradients and those of unrounded f64, compared with the
/// cosine of f64 with the same roundings.
const COSINE: f64 = 1e-4;

/// Largest difference, relative to the largest expected magnitude.
fn error(ours: &[f32], expected: &[f64]) -> f64 {
    assert_eq!(ours.len(), expected.len());
    let largest = expected.iter().fold(0f64, |m, v| m.max(v.abs()));
    assert!(largest > 0.0, "expecting zeros proves nothing");
    let differences = ours.iter().zip(expected).map(|(a, b)| {
        assert!(a.is_finite());
        (f64::from(*a) - b).abs()
    });
    differences.fold(0.0, f64::max) / largest
}

fn cosine(ours: &[f32], expected: &[f64]) -> f64 {
    let (mut dot, mut a, mut b) = (0.0, 0.0, 0.0);
    for (x, y) in ours.iter().zip(expected) {
        let x = f64::from(*x);
        (dot, a, b) = (dot + x * y, a + x * x, b + y * y);
    }
    dot / (a * b).sqrt()
}

#[test]
fn every_form_equals_f64() {
    for form in Form::available() {
        for (name, plan) in plans() {
            let mut worst = [0f64; 3];
            for (seed, rows) in SIZES.into_iter().enumerate() {
                let (params, input, grad) = case(&plan, rows, seed as u64);
                let expected = exact(&params, &input, &grad, &plan);
                let output = forward(&params, &input, &plan, form);
                let (to_params, to_input) = backward(&params, &input, &grad, &plan, true, form);
                let to_input = to_input.expect("needed");
                for (worst, error) in worst.iter_mut().zip([
                    error(&output, &expected.output),
                    error(&to_params, &expected.params),
                    error(&to_input, &expected.input),
                ]) {
                    *worst = worst.max(error);
                }
            }
            let [output, params, input] = worst;
            println!("| f32 {form:?} | {name} | {output:.1e} | {params:.1e} | {input:.1e} |");
            assert!(output < VALUES, "{form:?}, {name}: {output:e}");
            assert!(params < GRADIENTS, "{form:?}, {name}: {params:e}");
            assert!(input < GRADIENTS, "{form:?}, {name}: {input:e}");
        }
    }
}

#[test]
fn every_form_of_bf16_equals_f64_rounded_alike() {
    for form in Form::available() {
        for (name, plan) in plans() {
            let rounded = MlpPlan {
                precision: Precision::Bf16,
                ..plan.clone()
            };
            let mut worst = [0f64; 3];
            let mut lost = [f64::NEG_INFINITY; 3];
            let mut least = [1f64; 3];
            for (seed, rows) in SIZES.into_iter().enumerate() {
                let (params, input, grad) = case(&plan, rows, seed as u64);
                let alike = exact(&params, &input, &grad, &rounded);
                let unrounded = exact(&params, &input, &grad, &plan);
                let output = forward(&params, &input, &rounded, form);
                let (to_params, to_input) = backward(&params, &input, &grad, &rounded, true, form);
                let to_input = to_input.expect("needed");
                for (i, (ours, alike, unrounded)) in [
                    (&output, &alike.output, &unrounded.output),
                    (&to_params, &alike.params, &unrounded.params),
                    (&to_input, &alike.input, &unrounded.input),
                ]
                .into_iter()
                .enumerate()
                {
                    worst[i] = worst[i].max(error(ours, alike));
                    if rows >= 100 {
                        let own = cosine(ours, unrounded);
                        let alike: Vec<f32> = alike.iter().map(|v| *v as f32).collect();
                        least[i] = least[i].min(own);
                        lost[i] = lost[i].max(cosine(&alike, unrounded) - own);
                    }
                }
            }
            println!(
                "| bf16 {form:?} | {name} | {:.1e} | {:.1e} | {:.1e} | 1 − {:.1e} | 1 − {:.1e} | 1 − {:.1e} |",
                worst[0],
                worst[1],
                worst[2],
                1.0 - least[0],
                1.0 - least[1],
                1.0 - least[2]
            );
            assert!(
                worst.iter().all(|e| *e < ROUNDED),
                "{form:?}, {name}: {worst:?}"
            );
            assert!(
                lost.iter().all(|c| *c < COSINE),
                "{form:?}, {name}: {lost:?}"
            );
        }
    }
}

fn tensor<const D: usize>(values: &[f32], shape: [usize; D], device: &Device) -> Tensor<D> {
    Tensor::from_data(TensorData::new(values.to_vec(), shape), device)
}

#[test]
fn the_operation_equals_its_reference() {
    let device = Device::flex().autodiff();
    for (precision, bounds) in [
        (Precision::F32, [VALUES, GRADIENTS]),
        (Precision::Bf16, [1e-4, ROUNDED]),
    ] {
        for (name, plan) in plans() {
            let plan = MlpPlan { precision, ..plan };
            let (params, input, grad) = case(&plan, 333, 5);
            type Run = fn(Tensor<1>, Tensor<2>, &MlpPlan) -> Tensor<2>;
            let run = |form: Run| {
                let params = tensor(&params, [params.len()], &device).require_grad();
                let input = tensor(&input, [333, plan.input.given()], &device).require_grad();
                let output = form(params.clone(), input.clone(), &plan);
                let towards = tensor(&grad, [333, plan.output], &device);
                let grads = (output.clone() * towards).sum().backward();
                let read = |values: Vec<f32>| values;
                [
                    read(output.try_into_vec_as().expect("f32")),
                    read(
                        params
                            .grad(&grads)
                            .expect("tracked")
                            .try_into_vec_as()
                            .expect("f32"),
                    ),
                    read(
                        input
                            .grad(&grads)
                            .expect("tracked")
                            .try_into_vec_as()
                            .expect("f32"),
                    ),
                ]
            };
            let (ours, reference) = (run(mlp::mlp), run(mlp::reference::mlp));
            for (i, part) in ["output", "parameters", "input"].iter().enumerate() {
                let expected: Vec<f64> = reference[i].iter().map(|v| f64::from(*v)).collect();
                let error = error(&ours[i], &expected);
                let bound = bounds[i.min(1)];
                assert!(error < bound, "{precision:?}, {name}, {part}: {error:e}");
            }
        }
    }
}

#[test]
fn rows_without_a_gradient_change_nothing() {
    for form in Form::available() {
        for (name, plan) in plans() {
            let rows = 700;
            let (params, input, mut grad) = case(&plan, rows, 9);
            let (given, output) = (plan.input.given(), plan.output);
            let live = |row: usize| row % 7 == 2 || row > 650;
            let (mut some_input, mut some_grad) = (Vec::new(), Vec::new());
            for row in 0..rows {
                let own = &mut grad[row * output..(row + 1) * output];
                if live(row) {
                    some_input.extend_from_slice(&input[row * given..(row + 1) * given]);
                    some_grad.extend_from_slice(own);
                } else {
                    own.fill(0.0);
                }
            }
            let (to_params, to_input) = backward(&params, &input, &grad, &plan, true, form);
            let (alone, alone_input) =
                backward(&params, &some_input, &some_grad, &plan, true, form);
            assert_eq!(to_params, alone, "{form:?}, {name}");
            let (to_input, alone_input) = (to_input.expect("needed"), alone_input.expect("needed"));
            let mut alone_rows = alone_input.chunks(given);
            for (row, ours) in to_input.chunks(given).enumerate() {
                if live(row) {
                    assert_eq!(Some(ours), alone_rows.next(), "{form:?}, {name}: row {row}");
                } else {
                    assert!(
                        ours.iter().all(|g| *g == 0.0),
                        "{form:?}, {name}: row {row}"
                    );
                }
            }
            let (_, none) = backward(&params, &input, &grad, &plan, false, form);
            assert!(none.is_none());
            let nothing = vec![0f32; grad.len()];
            let (to_params, to_input) = backward(&params, &input, &nothing, &plan, true, form);
            let all = to_params.iter().chain(to_input.iter().flatten());
            assert!(all.into_iter().all(|g| *g == 0.0));
        }
    }
}

#[test]
fn gradients_are_the_same_bits_with_any_number_of_threads() {
    let (_, plan) = plans().swap_remove(2);
    for precision in [Precision::F32, Precision::Bf16] {
        let plan = MlpPlan {
            precision,
            ..plan.clone()
        };
        let (params, input, grad) = case(&plan, 20_000, 11);
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .expect("threads");
            pool.install(|| backward(&params, &input, &grad, &plan, true, Form::best()))
        };
        let one = run(1);
        for threads in [2, 3, 7] {
            assert!(run(threads) == one, "{precision:?}, {threads} threads");
        }
    }
}

#[test]
fn infinity_and_nan_show_and_affect_no_other_row() {
    for form in Form::available() {
        for precision in [Precision::F32, Precision::Bf16] {
            for (name, plan) in plans() {
                let plan = MlpPlan { precision, ..plan };
                let rows = 30;
                let (params, mut input, grad) = case(&plan, rows, 13);
                let given = plan.input.given();
                for (row, value) in [(3, f32::NAN), (17, f32::INFINITY), (22, -f32::INFINITY)] {
                    input[row * given..(row + 1) * given].fill(value);
                }
                let output = forward(&params, &input, &plan, form);
                for (row, output) in output.chunks(plan.output).enumerate() {
                    let is_affected = output.iter().any(|v| !v.is_finite());
                    let expected = [3, 17, 22].contains(&row);
                    assert_eq!(
                        is_affected, expected,
                        "{form:?}, {precision:?}, {name}: row {row}"
                    );
                }
                let (to_params, _) = backward(&params, &input, &grad, &plan, true, form);
                assert!(to_params.iter().any(|g| !g.is_finite()));
            }
        }
    }
}

#[test]
fn far_points_are_encoded_as_precisely_as_near_ones() {
    // The first layer's weights pick out single numbers of the encoding.
    let input = frequencies(10, true, None);
    let width = input.width();
    let plan = plan(input, Vec::new(), width);
    let mut params = vec![0f32; plan.parameters()];
    for k in 0..width {
        params[k * width + k] = 1.0;
    }
    let mut rng = ChaCha8Rng::seed_from_u64(17);
    for scale in [1e-3f32, 1.0, 30.0, 1e4] {
        let points: Vec<f32> = (0..3 * 257)
            .map(|_| rng.random_range(-scale..scale))
            .collect();
        let expected = exact(&params, &points, &vec![0.0; 257 * width], &plan);
        for form in Form::available() {
            let output = forward(&params, &points, &plan, form);
            let worst = output
                .chunks(width)
                .zip(expected.output.chunks(width))
                .flat_map(|(ours, exact)| ours[3..].iter().zip(&exact[3..]))
                .map(|(a, b)| (f64::from(*a) - b).abs())
                .fold(0.0, f64::max);
            println!("| encoding {form:?} | to {scale:e} m | {worst:.1e} |");
            assert!(worst < 1.5e-7, "{form:?}, {scale} m: {worst:e}");
        }
    }
}

#[test]
#[should_panic(expected = "numbers of the parameters")]
fn parameters_of_another_network_are_refused() {
    let (_, plan) = plans().swap_remove(0);
    forward(&[0.0; 5], &[0.0; 3], &plan, Form::best());
}

#[test]
#[should_panic(expected = "numbers of the gradient")]
fn a_gradient_of_another_size_is_refused() {
    let (_, plan) = plans().swap_remove(0);
    let params = vec![0.0; plan.parameters()];
    backward(&params, &[0.0; 6], &[0.0; 4], &plan, true, Form::best());
}
