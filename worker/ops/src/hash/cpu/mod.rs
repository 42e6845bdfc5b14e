//! The hash grid on CPU threads. Sixteen points are processed at a time: their positions in the
//! cells of a level are computed in vectors, and only the look-ups are scalar.
//!
//! The forward pass runs over blocks of points. The backward pass runs over levels, whose rows are
//! disjoint, so that the order of the sums does not depend on the number of threads. Points whose gradient is 0
//! are left out first.

mod backward;
mod cells;
mod forward;
#[cfg(test)]
mod tests;

use super::{HashGrid, HashOps};
use crate::flex::tensor;
use crate::form::Form;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Flex, TensorMetadata};

/// Points per task of the forward pass, and of the preparation of the backward pass.
const BLOCK: usize = 512;

impl HashOps for Flex {
    fn hash_encode(
        table: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grid: HashGrid,
    ) -> FloatTensor<Self> {
        let rows = points.shape()[0];
        let [table, points] = [table, points].map(|tensor| tensor.to_contiguous());
        let output = forward(table.storage(), points.storage(), &grid);
        tensor(output, [rows, grid.width()])
    }

    fn hash_encode_backward(
        table: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        grid: HashGrid,
        needs_points_grad: bool,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        let entries = table.shape()[0];
        let [table, points, grad] = [table, points, grad].map(|tensor| tensor.to_contiguous());
        let (to_table, to_points) = backward(
            table.storage(),
            points.storage(),
            grad.storage(),
            &grid,
            needs_points_grad,
        );
        let rows = to_points.len() / 3;
        (
            tensor(to_table, [entries, grid.features]),
            tensor(to_points, [rows, 3]),
        )
    }
}

/// Calls the instance of a function for the grid's number of features.
macro_rules! by_features {
    ($grid:expr, $function:path, ( $($argument:expr),* )) => {{
        use $function as function;
        match $grid.features {
            1 => function::<1>($($argument),*),
            2 => function::<2>($($argument),*),
            4 => function::<4>($($argument),*),
            8 => function::<8>($($argument),*),
            16 => function::<16>($($argument),*),
            other => panic!("{other} features per row: only 1, 2, 4, 8 and 16 are supported"),
        }
    }};
}

/// `[N, L F]` as in [`super::encode`], with [`Form::best`].
///
/// # Panics
/// If the sizes do not match the grid.
pub fn forward(table: &[f32], points: &[f32], grid: &HashGrid) -> Vec<f32> {
    forward_in(Form::best(), table, points, grid)
}

/// [`forward()`] in a given form.
///
/// # Panics
/// As [`forward()`].
pub fn forward_in(form: Form, table: &[f32], points: &[f32], grid: &HashGrid) -> Vec<f32> {
    check(table, points, grid);
    by_features!(grid, forward::forward, (form, table, points, grid))
}

/// Gradients to the table (same shape) and, if `needs_points_grad`, to the points `[N, 3]`; otherwise
/// the latter is empty.
///
/// # Panics
/// If the sizes do not match the grid.
pub fn backward(
    table: &[f32],
    points: &[f32],
    grad: &[f32],
    grid: &HashGrid,
    needs_points_grad: bool,
) -> (Vec<f32>, Vec<f32>) {
    backward_in(Form::best(), table, points, grad, grid, needs_points_grad)
}

/// [`backward()`] in a given form.
///
/// # Panics
/// As [`backward()`].
pub fn backward_in(
    form: Form,
    table: &[f32],
    points: &[f32],
    grad: &[f32],
    grid: &HashGrid,
    needs_points_grad: bool,
) -> (Vec<f32>, Vec<f32>) {
    check(table, points, grid);
    let numbers = points.len() / 3 * grid.width();
    assert_eq!(grad.len(), numbers, "numbers of the gradient");
    by_features!(
        grid,
        backward::backward,
        (form, table, points, grad, grid, needs_points_grad)
    )
}

/// Checks that every row that [`cells`] can compute exists, since look-ups are not bounds-checked.
///
/// # Panics
/// If not.
fn check(table: &[f32], points: &[f32], grid: &HashGrid) {
    let mut next = 0;
    for level in &grid.levels {
        let nodes = (level.cells as usize + 1).saturating_pow(3);
        let reaches = if level.dense {
            nodes <= level.rows && nodes <= u32::MAX as usize
        } else {
            level.rows.is_power_of_two()
        };
        assert!(
            level.offset == next && reaches && (1..1 << 23).contains(&level.cells),
            "a level without a row for each of its nodes: {level:?}"
        );
        next += level.rows;
    }
    assert_eq!(table.len(), next * grid.features, "numbers of the table");
    assert!(
        points.len().is_multiple_of(3),
        "{} numbers of points: 3 for each",
        points.len()
    );
}
