//! The hash grid on CPU threads. Sixteen points are taken at a time: where they stand in the
//! cells of a level is computed for all of them in vectors, and only the look-ups themselves go
//! one by one.
//!
//! Forward goes by blocks of points. Backward goes by levels, whose rows are disjoint, so that
//! sums come out in one order whatever the number of threads; points without a gradient are
//! left out before.

mod backward;
mod cells;
mod forward;

use super::HashGrid;
use crate::ops::form::Form;

/// Points a task of the forward form, and of the preparation of the backward form.
const BLOCK: usize = 512;

/// Calls the form made for the grid's number of features.
macro_rules! by_features {
    ($grid:expr, $function:path, ( $($argument:expr),* )) => {{
        use $function as function;
        match $grid.features {
            1 => function::<1>($($argument),*),
            2 => function::<2>($($argument),*),
            4 => function::<4>($($argument),*),
            8 => function::<8>($($argument),*),
            16 => function::<16>($($argument),*),
            other => panic!("{other} features: a row has 1, 2, 4, 8 or 16"),
        }
    }};
}

/// `[N, L F]` as in [`super::encode`], with the machine's best instructions.
pub fn forward(table: &[f32], points: &[f32], grid: &HashGrid) -> Vec<f32> {
    forward_in(Form::best(), table, points, grid)
}

/// [`forward`] in a given form.
pub fn forward_in(form: Form, table: &[f32], points: &[f32], grid: &HashGrid) -> Vec<f32> {
    check(table, grid);
    by_features!(grid, forward::forward, (form, table, points, grid))
}

/// Gradients to the table (same shape) and, if `points_too`, to the points `[N, 3]`; else an
/// empty one.
pub fn backward(
    table: &[f32],
    points: &[f32],
    grad: &[f32],
    grid: &HashGrid,
    points_too: bool,
) -> (Vec<f32>, Vec<f32>) {
    backward_in(Form::best(), table, points, grad, grid, points_too)
}

/// [`backward`] in a given form.
pub fn backward_in(
    form: Form,
    table: &[f32],
    points: &[f32],
    grad: &[f32],
    grid: &HashGrid,
    points_too: bool,
) -> (Vec<f32>, Vec<f32>) {
    check(table, grid);
    by_features!(
        grid,
        backward::backward,
        (form, table, points, grad, grid, points_too)
    )
}

/// Look-ups are not checked one by one: every row that [`cells`] can name must exist.
fn check(table: &[f32], grid: &HashGrid) {
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
            "a level whose rows don't hold its nodes: {level:?}"
        );
        next += level.rows;
    }
    assert_eq!(table.len(), next * grid.features, "the table's size");
}
