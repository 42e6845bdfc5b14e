//! Multiresolution hash grid (Müller et al., Instant NGP, 2022): a point's features are
//! trilinear look-ups in tables of growing resolution. Detail is stored where it is, so that
//! the network behind it can be small.

pub mod cpu;
#[cfg(feature = "gpu")]
pub(super) mod cube;
pub mod reference;

use super::{AvatarOps, has_own_form};
use burn::backend::Dispatch;
use burn::tensor::Tensor;

/// What y and z of a node are multiplied by in its hash (Instant NGP's).
pub(crate) const PRIMES: [u32; 2] = [2_654_435_761, 805_459_861];

/// Where a level's entries stand and how they are found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// Cells an axis.
    pub cells: u32,
    /// First row of the level in the table.
    pub offset: usize,
    /// Rows of the level.
    pub rows: usize,
    /// Whether nodes are numbered plainly (they fit) or hashed.
    pub dense: bool,
}

/// Shape of a grid, and the box it covers.
#[derive(Clone, Debug, PartialEq)]
pub struct HashGrid {
    /// Coarsest level first.
    pub levels: Vec<Level>,
    /// Numbers an entry: 1, 2, 4, 8 or 16.
    pub features: usize,
    /// Smallest corner of the box, metres.
    pub min: [f32; 3],
    /// Side of the cube that starts at `min`, metres. One scale for all axes keeps cells cubic.
    pub side: f32,
}

impl HashGrid {
    /// Lays out `levels` from `base` cells an axis, each `growth` times finer, in tables of at
    /// most `2^log2_rows` rows.
    pub fn new(
        levels: usize,
        base: usize,
        growth: f64,
        log2_rows: u32,
        features: usize,
        min: [f32; 3],
        side: f32,
    ) -> Self {
        let cells = |l| (base as f64 * growth.powi(l as i32)).floor() as u32;
        Self {
            levels: lay_out((0..levels).map(cells), log2_rows),
            features,
            min,
            side,
        }
    }

    /// The same cells in tables of at most `2^log2_rows` rows.
    pub fn within(&self, log2_rows: u32) -> Self {
        Self {
            levels: lay_out(self.levels.iter().map(|level| level.cells), log2_rows),
            ..self.clone()
        }
    }

    /// Rows of the whole table.
    pub fn rows(&self) -> usize {
        self.levels.iter().map(|level| level.rows).sum()
    }

    /// Numbers a point is encoded in.
    pub fn width(&self) -> usize {
        self.levels.len() * self.features
    }
}

/// Levels with these cells, one after the other.
fn lay_out(cells: impl Iterator<Item = u32>, log2_rows: u32) -> Vec<Level> {
    let most = 1usize << log2_rows;
    let mut offset = 0;
    cells
        .map(|cells| {
            let nodes = (cells as usize + 1).saturating_pow(3);
            let level = Level {
                cells,
                offset,
                rows: nodes.min(most),
                dense: nodes <= most,
            };
            offset += level.rows;
            level
        })
        .collect()
}

impl Level {
    /// Row of a node, relative to the level's first.
    #[inline(always)]
    pub fn row(&self, [x, y, z]: [u32; 3]) -> usize {
        if self.dense {
            let n = self.cells + 1;
            ((z * n + y) * n + x) as usize
        } else {
            let hash = x ^ y.wrapping_mul(PRIMES[0]) ^ z.wrapping_mul(PRIMES[1]);
            hash as usize & (self.rows - 1)
        }
    }
}

/// Of what [`encode`] yields for `points` of this shape.
#[cfg(feature = "gpu")]
pub(super) fn output_shape(points: &burn::tensor::Shape, grid: &HashGrid) -> burn::tensor::Shape {
    burn::tensor::Shape::new([points[0], grid.width()])
}

/// Of the gradient to `points` of this shape: without rows unless they are to have one.
#[cfg(feature = "gpu")]
pub(super) fn points_gradient_shape(
    points: &burn::tensor::Shape,
    points_too: bool,
) -> burn::tensor::Shape {
    burn::tensor::Shape::new([if points_too { points[0] } else { 0 }, 3])
}

/// Features of points: `table` `[rows, F]`, `points` `[N, 3]` metres → `[N, L F]`, coarsest
/// level first. A point outside the box takes the nearest inside. Gradients flow to both.
pub fn encode(table: Tensor<2>, points: Tensor<2>, grid: &HashGrid) -> Tensor<2> {
    if has_own_form(&points.device()) {
        Tensor::from_dispatch(Dispatch::hash_encode(
            table.into_dispatch(),
            points.into_dispatch(),
            grid.clone(),
        ))
    } else {
        reference::encode(table, points, grid)
    }
}
