//! Cubes that a hull is made of.

use yoto_ops::warp::WarpGrid;

/// Cubes that fill a box, x fastest.
pub(super) struct Cells {
    min: [f32; 3],
    spacing: f64,
    dims: [usize; 3],
}

impl Cells {
    /// Cubes with sides of `spacing` metres in the box of `grid`.
    pub(super) fn new(grid: &WarpGrid, spacing: f64) -> Self {
        let side = |a: usize| f64::from(grid.max[a] - grid.min[a]);
        Self {
            min: grid.min,
            spacing,
            dims: std::array::from_fn(|a| (side(a) / spacing).ceil() as usize),
        }
    }

    pub(super) fn count(&self) -> usize {
        self.dims.iter().product()
    }

    /// Column, row and layer of the cell with this `index`.
    pub(super) fn coordinates(&self, index: usize) -> [usize; 3] {
        let [x, y, _] = self.dims;
        [index % x, index / x % y, index / (x * y)]
    }

    /// The index of the cell with the coordinates `cell`; `None` outside the box.
    pub(super) fn index(&self, cell: [usize; 3]) -> Option<usize> {
        let [x, y, _] = self.dims;
        let inside = (0..3).all(|a| cell[a] < self.dims[a]);
        inside.then(|| (cell[2] * y + cell[1]) * x + cell[0])
    }

    /// The middle of the cell with the coordinates `cell`, metres.
    pub(super) fn middle(&self, cell: [usize; 3]) -> [f32; 3] {
        std::array::from_fn(|a| {
            (f64::from(self.min[a]) + self.spacing * (cell[a] as f64 + 0.5)) as f32
        })
    }

    /// The middles of the cells with these `indices`, metres.
    pub(super) fn middles(&self, indices: &[usize]) -> Vec<[f32; 3]> {
        let middles = indices
            .iter()
            .map(|index| self.middle(self.coordinates(*index)));
        middles.collect()
    }
}
