//! Rows of the table in `docs/research/numerics.md`, one per case.

use burn::tensor::Tensor;

/// Values of a tensor.
pub(crate) fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.try_into_vec_as().expect("f32")
}

/// Largest difference, relative to the larger of 1 and the largest reference magnitude.
pub(crate) fn error(ours: &[f32], reference: &[f64]) -> f64 {
    assert_eq!(ours.len(), reference.len());
    let scale = reference.iter().fold(1f64, |m, v| m.max(v.abs()));
    let differences = ours
        .iter()
        .zip(reference)
        .map(|(a, b)| (f64::from(*a) - b).abs());
    differences.fold(0.0, f64::max) / scale
}

/// Prints the row of a case and asserts that all values are finite, and close to the f64 reference
/// if there is one.
pub(crate) fn report(
    hazard: &str,
    case: &str,
    values: &[f32],
    gradients: &[f32],
    error: Option<f64>,
    bound: f64,
) {
    let worst = |numbers: &[f32]| numbers.iter().map(|v| v.abs()).fold(0f32, f32::max);
    let finite = |numbers: &[f32]| numbers.iter().all(|v| v.is_finite());
    let cell = |numbers: &[f32]| match (numbers.is_empty(), finite(numbers)) {
        (true, _) => "–".into(),
        (_, true) => format!("finite, to {:.1e}", worst(numbers)),
        (_, false) => "NOT FINITE".to_string(),
    };
    let shown = error.map_or("–".into(), |error| format!("{error:.1e}"));
    println!(
        "| {hazard} | {case} | {} | {} | {shown} |",
        cell(values),
        cell(gradients)
    );
    assert!(finite(values), "{hazard}, {case}: values {values:?}");
    assert!(
        finite(gradients),
        "{hazard}, {case}: gradients {gradients:?}"
    );
    assert!(
        error.is_none_or(|error| error <= bound),
        "{hazard}, {case}: error {shown} over {bound:e}"
    );
}
