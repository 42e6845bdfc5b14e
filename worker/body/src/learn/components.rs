//! Principal components of weighted rows.

use super::LearnError;
use faer::{Mat, Side};
use rayon::prelude::*;

/// The mean of rows and their principal components.
pub(super) struct Components {
    /// `[V]`.
    pub(super) mean: Vec<[f32; 3]>,
    /// `[C V]`, each times its standard deviation.
    pub(super) components: Vec<[f32; 3]>,
}

/// The `count` largest principal components of `rows`, `[N, V, 3]` with weights that sum to 1.
///
/// With Y = √w (x − x̄), `[N, 3V]`, the eigenvectors q of the Gram matrix Y Yᵀ = Q Λ Qᵀ, `[N, N]`, give Yᵀ q = σ U: there
/// are far fewer rows than columns.
pub(super) fn learn(
    mut rows: Vec<(Vec<[f32; 3]>, f64)>,
    count: usize,
) -> Result<Components, LearnError> {
    let size = rows.first().map_or(0, |(row, _)| row.len());
    let mut mean = vec![0f64; 3 * size];
    for (row, weight) in &rows {
        for (sum, number) in mean.iter_mut().zip(row.as_flattened()) {
            *sum += weight * f64::from(*number);
        }
    }
    rows.par_iter_mut().for_each(|(row, weight)| {
        let root = weight.sqrt();
        for (number, mean) in row.as_flattened_mut().iter_mut().zip(&mean) {
            *number = (root * (f64::from(*number) - mean)) as f32;
        }
    });
    let people = rows.len();
    let lower: Vec<Vec<f64>> = (0..people)
        .into_par_iter()
        .map(|r| (0..=r).map(|c| dot(&rows[r].0, &rows[c].0)).collect())
        .collect();
    let gram = Mat::from_fn(people, people, |r, c| lower[r.max(c)][r.min(c)]);
    let found = gram
        .self_adjoint_eigen(Side::Lower)
        .map_err(|_| LearnError::Decomposition)?;
    // Eigenvalues ascend.
    let component = |k: usize| -> Vec<[f32; 3]> {
        let shares: Vec<f64> = (0..people)
            .map(|r| found.U()[(r, people - 1 - k)])
            .collect();
        let mut sum = vec![[0f64; 3]; size];
        for ((row, _), share) in rows.iter().zip(shares) {
            for (sum, number) in sum.as_flattened_mut().iter_mut().zip(row.as_flattened()) {
                *sum += share * f64::from(*number);
            }
        }
        // An eigenvector's sign is arbitrary: the largest number is positive, so that every machine learns the same.
        let largest = |most: f64, number: &f64| {
            if number.abs() > most.abs() {
                *number
            } else {
                most
            }
        };
        let sign = sum.as_flattened().iter().fold(0.0, largest).signum();
        sum.iter()
            .map(|row| row.map(|number| (sign * number) as f32))
            .collect()
    };
    let components: Vec<Vec<[f32; 3]>> = (0..count.min(people))
        .into_par_iter()
        .map(component)
        .collect();
    Ok(Components {
        mean: mean
            .as_chunks::<3>()
            .0
            .iter()
            .map(|row| row.map(|number| number as f32))
            .collect(),
        components: components.concat(),
    })
}

/// Sum of the products, in lanes that vectorize.
fn dot(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    const LANES: usize = 16;
    let (a, b) = (a.as_flattened(), b.as_flattened());
    let (a, a_rest) = a.as_chunks::<LANES>();
    let (b, b_rest) = b.as_chunks::<LANES>();
    let mut sums = [0f64; LANES];
    for (a, b) in a.iter().zip(b) {
        for lane in 0..LANES {
            sums[lane] += f64::from(a[lane]) * f64::from(b[lane]);
        }
    }
    let rest = a_rest
        .iter()
        .zip(b_rest)
        .map(|(a, b)| f64::from(*a) * f64::from(*b));
    sums.iter().sum::<f64>() + rest.sum::<f64>()
}
