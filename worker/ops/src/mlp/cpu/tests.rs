//! Tiles without threads, so that Miri can check their pointers, against a plain network in f64.

use super::tile::{Gradients, Rows, Tiles};
use super::*;
use crate::Precision;
use crate::encode::Bands;
use crate::mlp::{Hidden, Input};

/// Output `[rows, output]` and gradients to the parameters and the input.
type Results = [Vec<f32>; 3];

/// More rows than a tile has at least, and not a multiple of any block.
const ROWS: usize = 51;

/// Networks with a skip and with widths that fill no vector.
fn plans() -> Vec<MlpPlan> {
    let hidden = |width, skip| Hidden { width, skip };
    let plan = |input, hidden, output| MlpPlan {
        input,
        hidden,
        output,
        precision: Precision::F32,
    };
    let points = Input::Frequencies {
        bands: Bands::new(2, 1.5),
        raw: true,
    };
    vec![
        plan(points, vec![hidden(5, false), hidden(6, true)], 3),
        plan(
            Input::Features { width: 4 },
            vec![hidden(9, false), hidden(3, false)],
            2,
        ),
        plan(Input::Features { width: 3 }, Vec::new(), 2),
    ]
}

/// Numbers in ±1.
fn numbers(count: usize, step: f32) -> Vec<f32> {
    (0..count).map(|i| (i as f32 * step).sin()).collect()
}

fn by_tiles(form: Form, plan: &MlpPlan, params: &[f32], input: &[f32], grad: &[f32]) -> Results {
    let layout = Layout::new(plan, kernels(form, plan.precision));
    let packed = layout.pack(params, true);
    let tiles = Tiles::new(&layout, &packed, input, false);
    let mut scratch = Words::zeroed(tiles.words());
    let mut output = vec![0f32; ROWS * plan.output];
    for (i, output) in output.chunks_mut(tiles.rows * plan.output).enumerate() {
        let rows = Rows::From(i * tiles.rows, output.len() / plan.output);
        tiles.forward(rows, scratch.words(), output);
    }

    let tiles = Tiles::new(&layout, &packed, input, true);
    let mut scratch = Words::zeroed(tiles.words());
    let mut sums = Words::zeroed(layout.gradients);
    let mut to_input = vec![0f32; input.len()];
    let mut gradients = Gradients {
        params: Region::new(sums.floats()),
        input: Some(&mut to_input),
        first: 0,
    };
    let rows: Vec<u32> = (0..ROWS as u32).collect();
    for rows in rows.chunks(tiles.rows.min(30)) {
        tiles.backward(Rows::Picked(rows), grad, scratch.words(), &mut gradients);
    }
    let to_params = layout.unpack(sums.read_floats(), params.len());
    [output, to_params, to_input]
}

/// The first layer's factor of one row, and its derivative with respect to each given number:
/// `[width]` pairs of the number's index and the derivative.
fn encoded(plan: &MlpPlan, given: &[f32]) -> (Vec<f64>, Vec<(usize, f64)>) {
    let given: Vec<f64> = given.iter().map(|x| f64::from(*x)).collect();
    let as_is = given.iter().enumerate().map(|(i, x)| (*x, (i, 1.0)));
    let Input::Frequencies { bands, raw } = &plan.input else {
        return as_is.unzip();
    };
    let mut columns: Vec<(f64, (usize, f64))> = as_is.take(if *raw { 3 } else { 0 }).collect();
    for (radians, weight) in bands.each() {
        let (radians, weight) = (f64::from(radians), f64::from(weight));
        let scaled = |value: f64, i: usize, slope: f64| (weight * value, (i, weight * slope));
        let angle = |i: usize| given[i] * radians;
        columns.extend((0..3).map(|i| scaled(angle(i).sin(), i, radians * angle(i).cos())));
        columns.extend((0..3).map(|i| scaled(angle(i).cos(), i, -radians * angle(i).sin())));
    }
    columns.into_iter().unzip()
}

fn plainly(plan: &MlpPlan, params: &[f32], input: &[f32], grad: &[f32]) -> Results {
    let layers = plan.layers();
    let mut output = Vec::new();
    let mut to_params = vec![0f64; params.len()];
    let mut to_input = Vec::new();
    let given = plan.input.given();
    for (row, grad) in input
        .chunks_exact(given)
        .zip(grad.chunks_exact(plan.output))
    {
        let (input, slopes) = encoded(plan, row);
        // Factors of each layer but the network's input, and the result.
        let mut results = vec![input.clone()];
        for (l, layer) in layers.iter().enumerate() {
            let result = (0..layer.columns).map(|c| {
                let mut sum = f64::from(params[layer.bias + c]);
                for part in &layer.parts {
                    let from = if part.input { &input } else { &results[l] };
                    for (k, x) in from.iter().enumerate() {
                        sum += x * f64::from(params[part.weight + k * layer.columns + c]);
                    }
                }
                if l + 1 < layers.len() {
                    sum.max(0.0)
                } else {
                    sum
                }
            });
            let result = result.collect();
            results.push(result);
        }
        output.extend(results[layers.len()].iter().map(|x| *x as f32));

        let mut to_result: Vec<f64> = grad.iter().map(|g| f64::from(*g)).collect();
        let mut to_encoded = vec![0f64; input.len()];
        for (l, layer) in layers.iter().enumerate().rev() {
            let mut to_before = vec![0f64; results[l].len()];
            for (c, g) in to_result.iter().enumerate() {
                to_params[layer.bias + c] += g;
                for part in &layer.parts {
                    let (from, to) = match part.input {
                        true => (&input, &mut to_encoded),
                        false => (&results[l], &mut to_before),
                    };
                    for k in 0..part.width {
                        let at = part.weight + k * layer.columns + c;
                        to_params[at] += from[k] * g;
                        to[k] += f64::from(params[at]) * g;
                    }
                }
            }
            let masked = to_before.iter().zip(&results[l]);
            to_result = masked
                .map(|(g, x)| if *x > 0.0 { *g } else { 0.0 })
                .collect();
        }
        let mut to_row = vec![0f64; given];
        for (g, (i, slope)) in to_encoded.iter().zip(slopes) {
            to_row[i] += g * slope;
        }
        to_input.extend(to_row.iter().map(|g| *g as f32));
    }
    let to_params = to_params.iter().map(|g| *g as f32).collect();
    [output, to_params, to_input]
}

#[test]
fn tiles_equal_a_plain_network_in_every_form() {
    for plan in plans() {
        let params = numbers(plan.parameters(), 0.9);
        let input = numbers(ROWS * plan.input.given(), 0.37);
        let grad = numbers(ROWS * plan.output, 1.3);
        let expected = plainly(&plan, &params, &input, &grad);
        for form in Form::available() {
            let ours = by_tiles(form, &plan, &params, &input, &grad);
            for (part, (ours, expected)) in ["output", "parameters", "input"]
                .iter()
                .zip(ours.iter().zip(&expected))
            {
                assert_eq!(ours.len(), expected.len());
                let largest = expected.iter().fold(0f32, |most, x| most.max(x.abs()));
                for (i, (a, b)) in ours.iter().zip(expected).enumerate() {
                    assert!(
                        (a - b).abs() < 1e-5 * largest,
                        "{plan:?}, {}, {part} {i}: {a} instead of {b}",
                        form.name()
                    );
                }
            }
        }
    }
}
