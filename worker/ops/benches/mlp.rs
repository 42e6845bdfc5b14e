//! Times of the network operation: `cargo bench --workspace --profile dev --bench mlp`. (The
//! development profile has the optimisations of the release, and is usually built already.)
//!
//! First a table of one thread's CPU time, which hardly depends on the load of the machine:
//! arithmetic per second of each form, its share of the thread's measured FMA peak, and the ratio to
//! the reference, which alternates with the operation. Then divan's figures, in wall time.

mod timing;

use burn::tensor::{Device, Tensor, TensorData};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::hint::black_box;
use timing::shortest;
use yoto_ops::Precision;
use yoto_ops::encode::Bands;
use yoto_ops::form::Form;
use yoto_ops::mlp::cpu::{backward, forward};
use yoto_ops::mlp::{self, Hidden, Input, MlpPlan};

/// Number of alternating runs of the operation and the reference; the fastest run of each counts.
const TURNS: usize = 3;
/// Divan's arguments.
const NETWORKS: [&str; 4] = ["canonical", "non-rigid", "fast canonical", "fast non-rigid"];

/// A network of the model, and its inputs.
struct Case {
    plan: MlpPlan,
    rows: usize,
    params: Vec<f32>,
    input: Vec<f32>,
    grad: Vec<f32>,
}

impl Case {
    fn new(name: &str) -> Self {
        let frequencies = |bands, raw| Input::Frequencies {
            bands: Bands::new(bands, 1.0),
            raw,
        };
        let (input, width, depth, skip, output, rows) = match name {
            "canonical" => (frequencies(10, true), 256, 8, Some(5), 4, 4096),
            "non-rigid" => (frequencies(6, false), 128, 6, Some(4), 3, 8192),
            "fast canonical" => (Input::Features { width: 16 }, 64, 3, None, 4, 65_536),
            _ => (frequencies(4, false), 32, 3, None, 3, 65_536),
        };
        let plan = MlpPlan {
            input,
            hidden: (0..depth)
                .map(|at| Hidden {
                    width,
                    skip: skip == Some(at),
                })
                .collect(),
            output,
            precision: Precision::F32,
        };
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let bound = (6.0 / width as f32).sqrt();
        let mut draw = |count: usize, bound: f32| -> Vec<f32> {
            (0..count)
                .map(|_| rng.random_range(-bound..bound))
                .collect()
        };
        Self {
            params: draw(plan.parameters(), bound),
            input: draw(rows * plan.input.given(), 1.0),
            grad: draw(rows * output, 1.0),
            plan,
            rows,
        }
    }

    fn with(&self, precision: Precision) -> MlpPlan {
        MlpPlan {
            precision,
            ..self.plan.clone()
        }
    }

    fn tensors(&self, device: &Device) -> (Tensor<1>, Tensor<2>, Tensor<2>) {
        let two = |values: &[f32], width: usize| {
            Tensor::<2>::from_data(TensorData::new(values.to_vec(), [self.rows, width]), device)
        };
        (
            Tensor::from_data(
                TensorData::new(self.params.clone(), [self.params.len()]),
                device,
            ),
            two(&self.input, self.plan.input.given()),
            two(&self.grad, self.plan.output),
        )
    }

    /// The operation, or its reference, through Burn's automatic differentiation.
    fn through_burn(&self, run: Run, backward: bool) {
        let device = if backward {
            Device::flex().autodiff()
        } else {
            Device::flex()
        };
        let (mut params, mut input, grad) = self.tensors(&device);
        if backward {
            (params, input) = (params.require_grad(), input.require_grad());
        }
        let output = run(params.clone(), input.clone(), &self.plan);
        if backward {
            let grads = (output * grad).sum().backward();
            black_box((params.grad(&grads), input.grad(&grads)));
        } else {
            black_box(output);
        }
    }
}

type Run = fn(Tensor<1>, Tensor<2>, &MlpPlan) -> Tensor<2>;

/// Shortest processor time of each of the works on this thread, seconds.
fn seconds<const N: usize>(works: [&mut dyn FnMut(); N]) -> [f64; N] {
    shortest(TURNS, works).map(|milliseconds| milliseconds / 1e3)
}

#[cfg(target_arch = "x86_64")]
mod peak {
    use std::arch::x86_64::*;

    /// Independent chains of multiply-adds of vectors.
    const CHAINS: usize = 14;

    macro_rules! chains {
        ($name:ident, $features:literal, $set:ident, $fma:ident, $add:ident, $lanes:literal) => {
            #[target_feature(enable = $features)]
            pub(super) fn $name(steps: usize) -> f64 {
                let (a, b) = ($set(0.999), $set(0.001));
                let mut sums = [$set(std::hint::black_box(1.0)); CHAINS];
                for _ in 0..steps {
                    for sum in &mut sums {
                        *sum = $fma(*sum, a, b);
                    }
                }
                let total = sums.into_iter().reduce(|x, y| $add(x, y));
                std::hint::black_box(total);
                (2 * $lanes * CHAINS * steps) as f64
            }
        };
    }

    chains!(
        avx512,
        "avx512f",
        _mm512_set1_ps,
        _mm512_fmadd_ps,
        _mm512_add_ps,
        16
    );
    chains!(
        avx2,
        "avx2,fma",
        _mm256_set1_ps,
        _mm256_fmadd_ps,
        _mm256_add_ps,
        8
    );
}

/// Peak rate of this thread's multiply-adds, FLOP per second of its CPU time.
#[cfg(target_arch = "x86_64")]
fn peak() -> Option<f64> {
    const STEPS: usize = 3_000_000;
    let run: fn() -> f64 = if is_x86_feature_detected!("avx512f") {
        // SAFETY: its instructions were just detected on this machine.
        || unsafe { peak::avx512(STEPS) }
    } else if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
        // SAFETY: its instructions were just detected on this machine.
        || unsafe { peak::avx2(2 * STEPS) }
    } else {
        return None;
    };
    let mut done = 0.0;
    let [seconds] = seconds([&mut || done = run()]);
    Some(done / seconds)
}

#[cfg(not(target_arch = "x86_64"))]
fn peak() -> Option<f64> {
    None
}

fn cosine(a: &[f32], b: &[f32]) -> f64 {
    let (mut dot, mut x, mut y) = (0.0, 0.0, 0.0);
    for (p, q) in a.iter().zip(b) {
        let (p, q) = (f64::from(*p), f64::from(*q));
        (dot, x, y) = (dot + p * q, x + p * p, y + q * q);
    }
    dot / (x * y).sqrt()
}

/// Prints the table of one network.
fn report(name: &str) {
    let case = Case::new(name);
    let products = 2.0 * case.plan.products() as f64 * case.rows as f64;
    let share = |flop: f64, seconds: f64, peak: Option<f64>| {
        let rate = flop / seconds;
        let share = peak.map_or("–".into(), |peak| format!("{:.0} %", 100.0 * rate / peak));
        format!("{:.1} GFLOP/s, {share}", rate / 1e9)
    };
    let mut exact = Vec::new();
    for precision in [Precision::F32, Precision::Bf16] {
        let plan = case.with(precision);
        for form in Form::available() {
            let (named, peak) = (form.name(), peak());
            let mut gradients = Vec::new();
            let [there, back] = seconds([
                &mut || {
                    black_box(forward(&case.params, &case.input, &plan, form));
                },
                &mut || {
                    gradients =
                        backward(&case.params, &case.input, &case.grad, &plan, true, form).0;
                },
            ]);
            if exact.is_empty() {
                exact.clone_from(&gradients);
            }
            println!(
                "| {name} | {precision:?} | {named} | {} | {} | {} | 1 − {:.0e} |",
                share(products, there, peak),
                share(3.0 * products, back, peak),
                // Useful are the forward pass and twice as much backward; the rest repeats the
                // forward pass.
                share(3.0 * products, there + back, peak),
                1.0 - cosine(&gradients, &exact),
            );
        }
    }
    let times = |backward| {
        let [ours, reference] =
            seconds([&mut || case.through_burn(mlp::mlp, backward), &mut || {
                case.through_burn(mlp::reference::mlp, backward)
            }]);
        reference / ours
    };
    println!(
        "| {name} | through Burn, against its own operations | forward {:.1} times, with backward {:.1} times faster |",
        times(false),
        times(true)
    );
}

#[divan::bench(args = NETWORKS, sample_count = 5, sample_size = 1)]
fn operation(bencher: divan::Bencher, name: &str) {
    let case = Case::new(name);
    bencher.bench_local(|| case.through_burn(mlp::mlp, true));
}

#[divan::bench(args = NETWORKS, sample_count = 5, sample_size = 1)]
fn reference(bencher: divan::Bencher, name: &str) {
    let case = Case::new(name);
    bencher.bench_local(|| case.through_burn(mlp::reference::mlp, true));
}

fn main() {
    // One thread runs everything, also the reference's products, so that its CPU time is that of
    // all work.
    let one = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .use_current_thread()
        .build_global();
    if let Err(error) = one {
        println!("several threads: {error}; CPU times are those of one of them");
    }
    println!(
        "| network | factors | form | forward | backward, all of its arithmetic | forward and backward, useful arithmetic | cosine of the weights' gradient with f32's |"
    );
    for name in NETWORKS {
        report(name);
    }
    divan::main();
}
