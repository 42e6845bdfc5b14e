//! Linear least squares with a ridge, by normal equations, for the residuals that a model leaves.
//!
//! The models have at most a few dozen columns, so a plain dense Cholesky factorisation is enough, and
//! this crate stays free of a linear algebra library.

/// The root mean square of the residuals of the linear model `values ≈ rows · factors`, per remaining
/// degree of freedom.
///
/// `rows` is `[N, C]` and `values` is `[N]`. The factors minimise
/// `|values - rows · factors|² + Σ ridge(c) factors[c]²`. `ridge` gives the variance of a value's error
/// divided by the expected variance of the column's factor.
///
/// `None` if fewer than half of the N degrees of freedom remain, or the equations are singular.
pub(super) fn residual_rms(
    rows: &[Vec<f64>],
    values: &[f64],
    ridge: impl Fn(usize) -> f64,
) -> Option<f64> {
    let columns = rows.first()?.len();
    let mut squares = vec![vec![0.0; columns]; columns];
    let mut sums = vec![0.0; columns];
    for (row, value) in rows.iter().zip(values) {
        for (i, a) in row.iter().enumerate() {
            sums[i] += a * value;
            for (j, b) in row.iter().enumerate() {
                squares[i][j] += a * b;
            }
        }
    }
    let mut damped = squares.clone();
    for (i, row) in damped.iter_mut().enumerate() {
        row[i] += ridge(i);
    }
    let lower = cholesky(&damped)?;
    let factors = solve(&lower, &sums);
    // Effective degrees of freedom: tr((AᵀA + Λ)⁻¹ AᵀA), the trace of the hat matrix. It is smaller than
    // the number of columns, as the ridge holds some factors back.
    let used: f64 = (0..columns).map(|i| solve(&lower, &squares[i])[i]).sum();
    let left = values.len() as f64 - used;
    if left < 0.5 * values.len() as f64 {
        return None;
    }
    let errors = rows.iter().zip(values).map(|(row, value)| {
        let explained: f64 = row.iter().zip(&factors).map(|(a, b)| a * b).sum();
        (value - explained).powi(2)
    });
    let rms = (errors.sum::<f64>() / left).sqrt();
    rms.is_finite().then_some(rms)
}

/// The Cholesky factor L of `matrix` = L Lᵀ; `None` if `matrix` is not positive definite.
fn cholesky(matrix: &[Vec<f64>]) -> Option<Vec<Vec<f64>>> {
    let count = matrix.len();
    let mut lower = vec![vec![0.0; count]; count];
    for i in 0..count {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| lower[i][k] * lower[j][k]).sum();
            let rest = matrix[i][j] - sum;
            if i != j {
                lower[i][j] = rest / lower[j][j];
            } else if rest > 0.0 {
                lower[i][i] = rest.sqrt();
            } else {
                return None;
            }
        }
    }
    Some(lower)
}

/// The solution x of L Lᵀ x = `right`, by forward and back substitution.
fn solve(lower: &[Vec<f64>], right: &[f64]) -> Vec<f64> {
    let count = right.len();
    let mut x = right.to_vec();
    for i in 0..count {
        let known: f64 = (0..i).map(|k| lower[i][k] * x[k]).sum();
        x[i] = (x[i] - known) / lower[i][i];
    }
    for i in (0..count).rev() {
        let known: f64 = (i + 1..count).map(|k| lower[k][i] * x[k]).sum();
        x[i] = (x[i] - known) / lower[i][i];
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_residuals_of_a_line_are_the_noise_around_it() {
        let rows: Vec<Vec<f64>> = (0..40).map(|i| vec![1.0, f64::from(i)]).collect();
        let line: Vec<f64> = rows.iter().map(|row| 3.0 - 0.5 * row[1]).collect();
        let exact = residual_rms(&rows, &line, |_| 1e-9).expect("enough");
        assert!(exact < 1e-6, "{exact}");
        let alternating = |i: usize| if i.is_multiple_of(2) { 0.1 } else { -0.1 };
        let noisy: Vec<f64> = (line.iter().enumerate())
            .map(|(i, value)| value + alternating(i))
            .collect();
        let found = residual_rms(&rows, &noisy, |_| 1e-9).expect("enough");
        assert!((found - 0.1).abs() < 0.01, "{found}");
        // A column with a large ridge explains little.
        let stiff = residual_rms(&rows, &line, |column| [1e-9, 1e9][column]).expect("enough");
        assert!(stiff > 1.0, "{stiff}");
        assert_eq!(residual_rms(&rows[..3], &line[..3], |_| 1e-9), None);
        let same = vec![vec![1.0, 1.0]; 9];
        assert_eq!(residual_rms(&same, &[1.0; 9], |_| 0.0), None);
        assert_eq!(residual_rms(&[], &[], |_| 0.0), None);
    }
}
