//! Normal equations of a least-squares problem.

/// `H x = b`, of which the lower half of the symmetric `H` `[n, n]` is kept.
#[derive(Clone)]
pub(super) struct Normal {
    h: Vec<f64>,
    b: Vec<f64>,
}

impl Normal {
    /// The equations of `n` unknowns without any residual.
    pub(super) fn new(n: usize) -> Self {
        Self {
            h: vec![0.0; n * n],
            b: vec![0.0; n],
        }
    }

    /// Adds the residual `value` − `row` · x, with a weight.
    pub(super) fn add_residual(&mut self, row: &[f64], value: f64, weight: f64) {
        let n = self.b.len();
        for (i, &by) in row.iter().enumerate() {
            if by == 0.0 {
                continue;
            }
            let by = weight * by;
            self.b[i] += by * value;
            for (h, other) in self.h[i * n..=i * n + i].iter_mut().zip(row) {
                *h += by * other;
            }
        }
    }

    /// Adds a prior on the unknown `i` with the mean `value` and a weight, which is its precision.
    pub(super) fn add_prior(&mut self, i: usize, value: f64, weight: f64) {
        self.h[i * (self.b.len() + 1)] += weight;
        self.b[i] += weight * value;
    }

    /// The solution, by Cholesky's factors; `None` if `H` is not positive definite or a number is
    /// not finite.
    pub(super) fn solve(self) -> Option<Vec<f64>> {
        Some(self.solve_with_variances()?.0)
    }

    /// The solution, and the diagonal of H⁻¹.
    pub(super) fn solve_with_variances(self) -> Option<(Vec<f64>, Vec<f64>)> {
        let Self { h: mut l, b: mut x } = self;
        let n = x.len();
        for i in 0..n {
            for j in 0..=i {
                let before: f64 = (0..j).map(|k| l[i * n + k] * l[j * n + k]).sum();
                let rest = l[i * n + j] - before;
                if i > j {
                    l[i * n + j] = rest / l[j * n + j];
                } else if rest > 0.0 && rest.is_finite() {
                    l[i * n + i] = rest.sqrt();
                } else {
                    return None;
                }
            }
        }
        for i in 0..n {
            let before: f64 = (0..i).map(|k| l[i * n + k] * x[k]).sum();
            x[i] = (x[i] - before) / l[i * n + i];
        }
        for i in (0..n).rev() {
            let after: f64 = (i + 1..n).map(|k| l[k * n + i] * x[k]).sum();
            x[i] = (x[i] - after) / l[i * n + i];
        }
        let finite = x.iter().all(|v| v.is_finite());
        finite.then(|| (x, variances(&l, n)))
    }
}

/// The diagonal of (L Lᵀ)⁻¹: the squared columns of L⁻¹.
fn variances(l: &[f64], n: usize) -> Vec<f64> {
    let column = |at: usize| {
        let mut inverse = vec![0.0; n];
        for i in at..n {
            let one = if i == at { 1.0 } else { 0.0 };
            let before: f64 = (at..i).map(|k| l[i * n + k] * inverse[k]).sum();
            inverse[i] = (one - before) / l[i * n + i];
        }
        inverse.iter().map(|v| v * v).sum()
    };
    (0..n).map(column).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equations_that_agree_are_solved() {
        let x = [0.5, -2.0, 3.0];
        let mut normal = Normal::new(3);
        for row in [
            [1.0, 2.0, 0.0],
            [0.0, -1.0, 4.0],
            [2.0, 0.0, 1.0],
            [1.0, 1.0, 1.0],
        ] {
            let value = row.iter().zip(x).map(|(a, b)| a * b).sum();
            normal.add_residual(&row, value, 3.0);
        }
        let found = normal.solve().expect("definite");
        for (found, x) in found.iter().zip(x) {
            assert!((found - x).abs() < 1e-12, "{found} for {x}");
        }
    }

    #[test]
    fn variances_are_those_of_the_inverse() {
        let mut normal = Normal::new(2);
        normal.add_residual(&[2.0, 1.0], 0.0, 1.0);
        normal.add_residual(&[0.0, 1.0], 0.0, 1.0);
        // H = [4 2; 2 2], so that H⁻¹ = [0.5 -0.5; -0.5 1].
        let (_, found) = normal.solve_with_variances().expect("definite");
        assert!(
            (found[0] - 0.5).abs() < 1e-12 && (found[1] - 1.0).abs() < 1e-12,
            "{found:?}"
        );
    }

    #[test]
    fn unknowns_without_a_residual_need_a_prior() {
        let one_residual = || {
            let mut normal = Normal::new(2);
            normal.add_residual(&[2.0, 0.0], 2.0, 1.0);
            normal
        };
        assert_eq!(one_residual().solve(), None);
        let mut normal = one_residual();
        normal.add_prior(1, 7.0, 1e-6);
        assert_eq!(normal.solve(), Some(vec![1.0, 7.0]));
        let mut normal = one_residual();
        normal.add_prior(1, f64::NAN, 1.0);
        assert_eq!(normal.solve(), None);
    }
}
