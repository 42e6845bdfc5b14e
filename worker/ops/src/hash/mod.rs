//! Multiresolution hash grid (Müller and others, Instant NGP, arXiv 2201.05989): the features of a point are
//! trilinear look-ups in tables of growing resolution. Detail is stored by position, so that the network behind the
//! grid can be small.

mod autodiff;
pub mod cpu;
#[cfg(feature = "gpu")]
mod cube;
pub mod reference;

use super::has_own_form;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, backend_extension};
use burn::tensor::Tensor;

/// Factors π₂ and π₃ of y and z in the hash of a node (Instant NGP, eq. 4; π₁ = 1).
pub const PRIMES: [u32; 2] = [2_654_435_761, 805_459_861];

/// The rows of a level in the table, and how the row of a node is found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// Cells per axis.
    pub cells: u32,
    /// First row of the level in the table.
    pub offset: usize,
    /// Rows of the level.
    pub rows: usize,
    /// Whether every node has a row of its own, x fastest; otherwise nodes are hashed to rows.
    pub dense: bool,
}

/// Levels of a grid and the cube that it covers.
#[derive(Clone, Debug, PartialEq)]
pub struct HashGrid {
    /// Coarsest level first.
    pub levels: Vec<Level>,
    /// Numbers per entry: 1, 2, 4, 8 or 16.
    pub features: usize,
    /// Smallest corner of the cube, metres.
    pub min: [f32; 3],
    /// Side of the cube that starts at `min`, metres. One scale for all axes keeps cells cubic.
    pub side: f32,
}

impl HashGrid {
    /// A grid of `levels` levels with at most `2^log2_rows` rows each. The first level has `base` cells per axis,
    /// each further one `growth` times more.
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

    /// A grid of the same cells whose levels have at most `2^log2_rows` rows.
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

    /// Numbers per encoded point: `L F`.
    pub fn width(&self) -> usize {
        self.levels.len() * self.features
    }
}

/// Levels with these numbers of cells per axis, one after the other in the table.
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
    /// Row of a node, relative to the first row of the level.
    #[inline(always)]
    pub fn row(&self, [x, y, z]: [u32; 3]) -> usize {
        if self.dense {
            let n = self.cells + 1;
            ((z * n + y) * n + x) as usize
        } else {
            // h = x ⊕ π₂ y ⊕ π₃ z mod T (eq. 4); T is a power of two
            let hash = x ^ y.wrapping_mul(PRIMES[0]) ^ z.wrapping_mul(PRIMES[1]);
            hash as usize & (self.rows - 1)
        }
    }
}

/// The hash grid as a backend implements it. Call [`encode`] instead, which chooses the form for the
/// tensors' device.
#[backend_extension(Autodiff, Flex, Cube: cfg(feature = "gpu"), Fusion: cfg(feature = "gpu"))]
pub trait HashOps: Backend {
    /// Forward of [`encode`].
    #[fusion(dtype = points, shape = output_shape(points, grid))]
    fn hash_encode(
        table: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grid: HashGrid,
    ) -> FloatTensor<Self>;
    /// Gradients of [`encode`] to the table and, if `needs_points_grad`, to the points, from
    /// `grad` `[N, L F]`; otherwise the latter has no rows.
    #[fusion(meta = |table, points, _, _, needs_points_grad| {
        let mut to_points = points.clone();
        to_points.shape = points_gradient_shape(&points.shape, *needs_points_grad);
        (table.clone(), to_points)
    })]
    fn hash_encode_backward(
        table: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        grid: HashGrid,
        needs_points_grad: bool,
    ) -> (FloatTensor<Self>, FloatTensor<Self>);
}

/// Shape of the result of [`encode`] for `points` of this shape.
#[cfg(feature = "gpu")]
fn output_shape(points: &burn::tensor::Shape, grid: &HashGrid) -> burn::tensor::Shape {
    burn::tensor::Shape::new([points[0], grid.width()])
}

/// Shape of the gradient to `points` of this shape: without rows if it is not needed.
#[cfg(feature = "gpu")]
fn points_gradient_shape(
    points: &burn::tensor::Shape,
    needs_points_grad: bool,
) -> burn::tensor::Shape {
    burn::tensor::Shape::new([if needs_points_grad { points[0] } else { 0 }, 3])
}

/// Features of points: `table` `[rows, F]`, `points` `[N, 3]` in metres → `[N, L F]`, coarsest
/// level first. A point outside the cube has the features of the nearest point in it. Gradients
/// flow to both.
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
