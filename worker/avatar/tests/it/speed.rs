//! A guard of the speed of a step, as a ratio within one process: a step of splats against a fixed amount of arithmetic
//! with the same instructions, both in processor time of one thread, so that neither the load of the
//! machine nor its number of cores counts.

use crate::support::{options, people};
use burn::tensor::Device;
use cpu_time::ThreadTime;
use std::hint::black_box;
use std::time::Duration;
use yoto_avatar::config::{ModelConfig, Refine};
use yoto_avatar::train::Trainer;
use yoto_ops::form::{Form, Work, multiply_add};

/// A step in units of [`Arithmetic`], measured on two cores of an AMD EPYC with AVX-512.
const STEP: f64 = 44.7;
/// Most by which a step may be slower. A change of a few percent belongs in a benchmark (docs/research/performance.md).
const MOST: f64 = 1.7;
/// Steps before the first that is timed, and timed ones.
const BEFORE: usize = 5;
const TIMED: usize = 25;

/// Four million multiplications and additions in the first cache.
struct Arithmetic<'a>(&'a mut [f32]);

impl Work for Arithmetic<'_> {
    type Output = ();
    #[inline(always)]
    fn run<const FMA: bool>(self) {
        for _ in 0..1000 {
            for value in self.0.iter_mut() {
                *value = multiply_add::<FMA>(*value, 0.999, 1e-3);
            }
        }
    }
}

#[test]
fn a_step_of_splats_is_as_fast_as_it_was() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let ratio = pool.expect("a pool").install(|| {
        let mut config = ModelConfig::named("splat", "yoto").expect("a tier");
        config.appearance.splats_mut().expect("splats").count = 2000;
        config.refinement.who = Refine::Never;
        let people = people(&[0, 1], 12, 64);
        let steps = (BEFORE + TIMED) as u64;
        let device = Device::flex();
        let mut trainer = Trainer::new(config, options(steps), people, &device).expect("starts");
        let mut numbers = vec![1.0f32; 4096];
        let (mut step, mut unit) = (Duration::MAX, Duration::MAX);
        for index in 0..BEFORE + TIMED {
            let began = ThreadTime::now();
            trainer.step().expect("a step");
            if index >= BEFORE {
                step = step.min(began.elapsed());
            }
            let began = ThreadTime::now();
            Form::best().run(Arithmetic(black_box(&mut numbers)));
            unit = unit.min(began.elapsed());
        }
        step.as_secs_f64() / unit.as_secs_f64()
    });
    println!("a step takes {ratio:.2} units");
    assert!(
        ratio < MOST * STEP,
        "a step takes {ratio:.2} units, not {STEP:.2}"
    );
}
