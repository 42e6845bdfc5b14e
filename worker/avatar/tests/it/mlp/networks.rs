//! The networks that the forms are compared on, and their parameters, inputs and gradients.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use yoto_avatar::config::Precision;
use yoto_ops::encode::Bands;
use yoto_ops::mlp::{Hidden, Input, MlpPlan};

fn hidden(widths: &[usize], skip: Option<usize>) -> Vec<Hidden> {
    let layer = |(at, width): (usize, &usize)| Hidden {
        width: *width,
        skip: skip == Some(at),
    };
    widths.iter().enumerate().map(layer).collect()
}

/// A network in f32.
pub(crate) fn plan(input: Input, hidden: Vec<Hidden>, output: usize) -> MlpPlan {
    MlpPlan {
        input,
        hidden,
        output,
        precision: Precision::F32,
    }
}

/// Encoded points.
pub(crate) fn frequencies(bands: usize, raw: bool, window: Option<Vec<f32>>) -> Input {
    Input::Frequencies {
        bands: Bands {
            window,
            ..Bands::new(bands, 1.0)
        },
        raw,
    }
}

/// Networks with odd widths, and small ones of the real shapes.
pub(crate) fn plans() -> Vec<(&'static str, MlpPlan)> {
    let window = Some(vec![1.0, 1.0, 0.5, 0.0]);
    vec![
        (
            "canonical, narrow",
            plan(frequencies(10, true, None), hidden(&[40; 4], Some(2)), 4),
        ),
        (
            "non-rigid, narrow",
            plan(frequencies(6, false, None), hidden(&[24; 4], Some(2)), 3),
        ),
        (
            "window",
            plan(frequencies(4, false, window), hidden(&[32; 3], None), 3),
        ),
        (
            "fast tier",
            plan(Input::Features { width: 16 }, hidden(&[64; 3], None), 4),
        ),
        (
            "odd widths",
            plan(
                Input::Features { width: 5 },
                hidden(&[36, 63, 24, 3], Some(2)),
                5,
            ),
        ),
        (
            "no hidden layer",
            plan(Input::Features { width: 7 }, Vec::new(), 2),
        ),
        (
            "wide output",
            plan(Input::Features { width: 69 }, hidden(&[33], None), 69),
        ),
    ]
}

/// Parameters, input and gradient of a network with active and inactive units.
pub(crate) fn case(plan: &MlpPlan, rows: usize, seed: u64) -> (Vec<f32>, Vec<f32>, Vec<f32>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut params = vec![0f32; plan.parameters()];
    for layer in plan.layers() {
        let fan: usize = layer.parts.iter().map(|part| part.width).sum();
        let bound = (6.0 / fan as f32).sqrt();
        for part in &layer.parts {
            for p in &mut params[part.weight..part.weight + part.width * layer.columns] {
                *p = rng.random_range(-bound..bound);
            }
        }
        for p in &mut params[layer.bias..layer.bias + layer.columns] {
            *p = rng.random_range(-0.2..0.2);
        }
    }
    let mut draw = |count: usize| (0..count).map(|_| rng.random_range(-1.5f32..1.5)).collect();
    (
        params,
        draw(rows * plan.input.given()),
        draw(rows * plan.output),
    )
}
