//! Non-negative least squares.

use faer::linalg::solvers::Solve;
use faer::{Mat, Side};

/// Steps without an answer, after which the last one is taken: rounding can make variables come and go for ever.
const STEPS: usize = 1000;
/// Part of the largest gradient below which the gradient is none.
const NONE: f64 = 1e-9;

/// The x ≥ 0 with the least xᵀ N x / 2 − rᵀ x, for the normal matrix N = AᵀA, `[n, n]`, and r = Aᵀb, `[n]`, with at most
/// `most` positive numbers.
///
/// The algorithm of Lawson and Hanson: the variable with the largest gradient becomes positive, and those that the
/// solution would make negative return to 0.
pub(super) fn solve(normal: &Mat<f64>, right: &[f64], most: usize) -> Vec<f64> {
    let n = right.len();
    let mut x = vec![0f64; n];
    let mut positive: Vec<usize> = Vec::new();
    let limit = NONE
        * right
            .iter()
            .fold(0f64, |most, number| most.max(number.abs()));
    for _ in 0..STEPS {
        let gradient = |row: usize| -> f64 {
            let product: f64 = positive
                .iter()
                .map(|column| normal[(row, *column)] * x[*column])
                .sum();
            right[row] - product
        };
        let free = (0..n).filter(|row| !positive.contains(row));
        let best = free
            .map(|row| (row, gradient(row)))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((entering, _)) = best.filter(|(_, gradient)| *gradient > limit) else {
            break;
        };
        if positive.len() >= most {
            break;
        }
        positive.push(entering);
        while let Some(solution) = unconstrained(normal, right, &positive) {
            // As far towards the solution as everything stays positive.
            let reach = |(at, wanted): (&usize, &f64)| {
                (*wanted <= 0.0).then(|| x[*at] / (x[*at] - wanted).max(f64::MIN_POSITIVE))
            };
            let steps = positive.iter().zip(&solution).filter_map(reach);
            let Some(step) = steps.reduce(f64::min) else {
                positive
                    .iter()
                    .zip(&solution)
                    .for_each(|(at, wanted)| x[*at] = *wanted);
                break;
            };
            for (at, wanted) in positive.iter().zip(&solution) {
                x[*at] += step * (wanted - x[*at]);
                if x[*at] <= 1e-12 && *wanted <= 0.0 {
                    x[*at] = 0.0;
                }
            }
            positive.retain(|at| x[*at] > 0.0);
        }
    }
    x
}

/// The solution of the rows and columns in `positive`; `None` if they are dependent or none.
fn unconstrained(normal: &Mat<f64>, right: &[f64], positive: &[usize]) -> Option<Vec<f64>> {
    let n = positive.len();
    let part = Mat::from_fn(n, n, |r, c| normal[(positive[r], positive[c])]);
    let right = Mat::from_fn(n, 1, |r, _| right[positive[r]]);
    let factor = part.llt(Side::Lower).ok().filter(|_| n > 0)?;
    let solution = factor.solve(&right);
    let solution: Vec<f64> = (0..n).map(|r| solution[(r, 0)]).collect();
    solution
        .iter()
        .all(|number| number.is_finite())
        .then_some(solution)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn negative_shares_become_none() {
        // Columns (1, 0), (0, 1), (1, 1); b = (2, −1): the best x ≥ 0 is (2, 0, 0).
        let columns = [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
        let product = |a: [f64; 2], b: [f64; 2]| a[0] * b[0] + a[1] * b[1];
        let normal = Mat::from_fn(3, 3, |r, c| product(columns[r], columns[c]));
        let right = columns.map(|column| product(column, [2.0, -1.0]));
        let x = solve(&normal, &right, 3);
        assert!(
            (x[0] - 2.0).abs() < 1e-9 && x[1] == 0.0 && x[2] == 0.0,
            "{x:?}"
        );
        // b = (2, 3) is 2 of the third and 1 of the second.
        let right = columns.map(|column| product(column, [2.0, 3.0]));
        let x = solve(&normal, &right, 3);
        let off = [x[0] + x[2] - 2.0, x[1] + x[2] - 3.0];
        assert!(off.iter().all(|off| off.abs() < 1e-9), "{x:?}");
        assert_eq!(
            solve(&normal, &right, 1)
                .iter()
                .filter(|x| **x > 0.0)
                .count(),
            1
        );
    }
}
