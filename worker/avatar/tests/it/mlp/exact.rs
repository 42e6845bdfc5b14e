//! The network in f64, row by row, with factors rounded to the plan's precision.

use yoto_avatar::config::Precision;
use yoto_ops::mlp::{Input, MlpPlan};

/// Expected results and gradients.
pub(crate) struct Exact {
    pub output: Vec<f64>,
    pub params: Vec<f64>,
    pub input: Vec<f64>,
}

/// A factor in `precision`: bf16 has 8 significant bits, ties round to even.
fn factor(value: f64, precision: Precision) -> f64 {
    if precision == Precision::F32 || value == 0.0 || !value.is_finite() {
        return value;
    }
    let unit = 2f64.powi(value.abs().log2().floor() as i32 - 7);
    (value / unit).round_ties_even() * unit
}

/// The encoded input of a row: each number, the coordinate that it depends on, and its derivative
/// with respect to that coordinate.
fn encoded(plan: &MlpPlan, row: &[f64]) -> Vec<(f64, usize, f64)> {
    match &plan.input {
        Input::Features { .. } => row.iter().enumerate().map(|(i, v)| (*v, i, 1.0)).collect(),
        Input::Frequencies { bands, raw } => {
            let mut all = Vec::new();
            if *raw {
                all.extend(row.iter().enumerate().map(|(c, v)| (*v, c, 1.0)));
            }
            for band in 0..bands.count {
                let scale = (1u64 << band) as f32 * bands.unit;
                let window = bands.window.as_ref();
                let weight = window.map_or(1.0, |w| f64::from(w[band]));
                // The angle in f32: its rounding is a part of the encoding, not an error.
                let angle = |v: f64| f64::from(v as f32 * scale);
                let scale = f64::from(scale);
                for (c, v) in row.iter().enumerate() {
                    let a = angle(*v);
                    all.push((weight * a.sin(), c, weight * scale * a.cos()));
                }
                for (c, v) in row.iter().enumerate() {
                    let a = angle(*v);
                    all.push((weight * a.cos(), c, -weight * scale * a.sin()));
                }
            }
            all
        }
    }
}

/// Results, and gradients for the gradient `grad` of the results.
pub(crate) fn exact(params: &[f32], input: &[f32], grad: &[f32], plan: &MlpPlan) -> Exact {
    let precision = plan.precision;
    let layers = plan.layers();
    let params: Vec<f64> = params.iter().map(|p| f64::from(*p)).collect();
    let weights: Vec<f64> = params.iter().map(|p| factor(*p, precision)).collect();
    let given = plan.input.given();
    let mut all = Exact {
        output: Vec::new(),
        params: vec![0.0; params.len()],
        input: Vec::new(),
    };
    for (row, grad) in input.chunks(given).zip(grad.chunks(plan.output)) {
        let row: Vec<f64> = row.iter().map(|v| f64::from(*v)).collect();
        let encoded = encoded(plan, &row);
        let first: Vec<f64> = encoded.iter().map(|e| factor(e.0, precision)).collect();
        let mut kept = vec![first.clone()];
        let mut result = Vec::new();
        for (l, layer) in layers.iter().enumerate() {
            let mut y = params[layer.bias..layer.bias + layer.columns].to_vec();
            for part in &layer.parts {
                let from = if part.input { &first } else { &kept[l] };
                for (k, x) in from.iter().enumerate() {
                    let at = part.weight + k * layer.columns;
                    for (y, w) in y.iter_mut().zip(&weights[at..at + layer.columns]) {
                        *y += x * w;
                    }
                }
            }
            if l + 1 < layers.len() {
                kept.push(y.iter().map(|y| factor(y.max(0.0), precision)).collect());
            } else {
                result = y;
            }
        }
        all.output.extend(result);
        let mut to: Vec<f64> = grad.iter().map(|g| f64::from(*g)).collect();
        let mut to_encoded = vec![0.0; first.len()];
        for (l, layer) in layers.iter().enumerate().rev() {
            for z in &mut to {
                *z = factor(*z, precision);
            }
            for (b, z) in all.params[layer.bias..].iter_mut().zip(&to) {
                *b += z;
            }
            let mut before = vec![0.0; kept[l].len()];
            for part in &layer.parts {
                let from = if part.input { &first } else { &kept[l] };
                for (k, x) in from.iter().enumerate() {
                    let at = part.weight + k * layer.columns;
                    let mut sum = 0.0;
                    for (n, z) in to.iter().enumerate() {
                        all.params[at + n] += x * z;
                        sum += z * weights[at + n];
                    }
                    if part.input {
                        to_encoded[k] += sum;
                    } else if *x > 0.0 {
                        before[k] += sum;
                    }
                }
            }
            to = before;
        }
        let mut to_row = vec![0.0; given];
        for ((_, c, slope), to) in encoded.iter().zip(&to_encoded) {
            to_row[*c] += slope * to;
        }
        all.input.extend(to_row);
    }
    all
}
