use crate::{numbers, relative_error, values};
use burn::tensor::{Device, Tensor, TensorData};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use yoto_ops::form::Form;
use yoto_ops::hash::{self, HashGrid};

/// A grid with dense and hashed levels.
fn hash_grid(features: usize) -> HashGrid {
    let grid = HashGrid::new(4, 3, 1.9, 7, features, [-1.0, -0.5, 0.0], 2.0);
    assert!(
        grid.levels[0].dense && !grid.levels[3].dense,
        "both kinds of level"
    );
    grid
}

/// More points than a task has, and an odd number.
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
        // Points without a gradient, single ones and many in a row.
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
fn gradients_of_the_hash_grid_do_not_depend_on_the_number_of_threads() {
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
fn infinite_and_nan_points_stay_inside_the_table() {
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
            let is_number = point.iter().all(|x| !x.is_nan());
            assert!(
                !is_number || row.iter().all(|v| (v - 1.0).abs() < 1e-5),
                "{point:?}"
            );
        }
        assert_eq!(to_table.len(), table.len());
    }
}

#[test]
#[should_panic(expected = "without a row for each of its nodes")]
fn a_grid_whose_levels_do_not_fit_is_refused() {
    let mut grid = hash_grid(2);
    let table = vec![0.0; 2 * grid.rows()];
    grid.levels[0].cells += 1;
    hash::cpu::forward(&table, &[0.0; 3], &grid);
}
