//! Gradients of the hash grid. They flow to the table and to the points; those to the points are computed
//! only if they are needed.

use super::{HashGrid, HashOps};
use crate::autodiff::{Saved, constants, record};
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend};

#[derive(Clone, Debug)]
struct SavedHash<B: Backend> {
    table: FloatTensor<B>,
    points: FloatTensor<B>,
    grid: HashGrid,
}

impl<B: HashOps> Saved<B, 2> for SavedHash<B> {
    fn gradients(self, grad: FloatTensor<B>, [_, points]: [bool; 2]) -> [FloatTensor<B>; 2] {
        B::hash_encode_backward(self.table, self.points, grad, self.grid, points).into()
    }
}

impl<B: HashOps, C: CheckpointStrategy> HashOps for Autodiff<B, C> {
    fn hash_encode(
        table: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grid: HashGrid,
    ) -> FloatTensor<Self> {
        record::<B, C, _, _>([table, points], |[table, points]| {
            let output = B::hash_encode(table.clone(), points.clone(), grid.clone());
            let saved = SavedHash {
                table,
                points,
                grid,
            };
            (output, saved)
        })
    }

    fn hash_encode_backward(
        table: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        grid: HashGrid,
        needs_points_grad: bool,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        constants::<B, C, _, _>([table, points, grad], |[table, points, grad]| {
            B::hash_encode_backward(table, points, grad, grid, needs_points_grad).into()
        })
        .into()
    }
}
