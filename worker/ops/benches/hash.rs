//! Times of the hash grid on this machine, in each form and in Burn's own tensor operations, on
//! points like those of training: patches of neighbouring rays through a body. Prints the shortest
//! processor time of many alternating runs on one thread, so that the load of other programs has little
//! effect.
//!
//! `cargo bench --workspace --bench hash --profile dev`, the profile of `cargo run`.

mod timing;

use burn::tensor::{Device, Tensor, TensorData};
use timing::{heading, line, noise, on_one_thread, shortest};
use yoto_ops::adam::{self, AdamRates};
use yoto_ops::form::Form;
use yoto_ops::hash::{self, HashGrid, cpu};

/// Number of runs of each form.
const RUNS: usize = 25;
/// Runs of the comparison with the reference, which is slow.
const REFERENCE_RUNS: usize = 5;
/// Patches, pixels per side of a patch, and samples per ray inside the body.
const PATCHES: usize = 8;
const SIDE: usize = 12;
const SAMPLES: usize = 23;

/// `[N, 3]` metres: pixels 1.5 cm apart, samples 1.2 cm.
fn points() -> Vec<f32> {
    let mut points = Vec::new();
    for patch in 0..PATCHES {
        let corner: [f32; 3] = std::array::from_fn(|a| 0.3 + noise(3 * patch + a));
        for pixel in 0..SIDE * SIDE {
            for sample in 0..SAMPLES {
                let jitter = noise(1000 + points.len());
                points.push(corner[0] + 0.015 * (pixel % SIDE) as f32);
                points.push(corner[1] + 0.015 * (pixel / SIDE) as f32);
                points.push(corner[2] + 0.012 * (sample as f32 + jitter));
            }
        }
    }
    points
}

/// Prints the times of the operation and of its reference through Burn's automatic
/// differentiation.
fn against_burn(grid: &HashGrid, table: &[f32], points: &[f32]) {
    let device = Device::flex().autodiff();
    let two = |values: &[f32], width: usize| {
        let data = TensorData::new(values.to_vec(), [values.len() / width, width]);
        Tensor::<2>::from_data(data, &device).require_grad()
    };
    let (table, points) = (two(table, grid.features), two(points, 3));
    let ours = || hash::encode(table.clone(), points.clone(), grid);
    let burns = || hash::reference::encode(table.clone(), points.clone(), grid);
    heading();
    line(
        "hash grid, forward",
        shortest(
            REFERENCE_RUNS,
            [&mut || drop(ours()), &mut || drop(burns())],
        ),
    );
    line(
        "hash grid, both ways",
        shortest(
            REFERENCE_RUNS,
            [&mut || drop(ours().sum().backward()), &mut || {
                drop(burns().sum().backward())
            }],
        ),
    );
}

fn measure() {
    // The tier `fast`.
    let grid = HashGrid::new(8, 16, 1.45, 15, 2, [0.0; 3], 2.0);
    let points = points();
    let n = points.len() / 3;
    let table: Vec<f32> = (0..grid.rows() * 2).map(|i| noise(i) - 0.5).collect();
    let full: Vec<f32> = (0..n * grid.width()).map(|i| noise(i) - 0.5).collect();
    let mut half = full.clone();
    for row in half.chunks_exact_mut(grid.width()).skip(1).step_by(2) {
        row.fill(0.0);
    }
    println!(
        "{n} points, {} levels, {} rows",
        grid.levels.len(),
        grid.rows()
    );
    println!("form      forward ms  backward ms  table only ms  half the points ms");
    for form in Form::of_loops() {
        let back = |grad: &[f32], too| {
            drop(cpu::backward_in(form, &table, &points, grad, &grid, too));
        };
        let [a, b, c, d] = shortest(
            RUNS,
            [
                &mut || drop(cpu::forward_in(form, &table, &points, &grid)),
                &mut || back(&full, true),
                &mut || back(&full, false),
                &mut || back(&half, true),
            ],
        );
        println!("{:<8} {a:>11.2} {b:>12.2} {c:>14.2} {d:>19.2}", form.name());
    }
    let (mut param, mut first, mut second) = (table.clone(), table.clone(), table.clone());
    second.iter_mut().for_each(|v| *v = v.abs());
    let rates = AdamRates::new(1e-2, 0.9, 0.999, 1e-8, 3);
    let [adam] = shortest(
        RUNS,
        [&mut || {
            adam::cpu::update(&mut param, &table, &mut first, &mut second, rates);
        }],
    );
    println!("Adam over the table: {adam:.2} ms");
    against_burn(&grid, &table, &points);
}

fn main() -> Result<(), rayon::ThreadPoolBuildError> {
    on_one_thread(measure)
}
