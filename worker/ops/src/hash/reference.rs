//! The hash grid in Burn's own tensor operations, which the tests compare the other forms with.

use super::{HashGrid, Level};
use burn::tensor::{Int, Tensor};

/// See [`super::encode`].
pub fn encode(table: Tensor<2>, points: Tensor<2>, grid: &HashGrid) -> Tensor<2> {
    let device = points.device();
    let min = Tensor::<1>::from_floats(grid.min, &device).unsqueeze::<2>();
    let unit = ((points - min) / grid.side).clamp(0.0, 1.0);
    let features = grid
        .levels
        .iter()
        .map(|level| level_features(table.clone(), unit.clone(), level))
        .collect();
    Tensor::cat(features, 1)
}

fn level_features(table: Tensor<2>, unit: Tensor<2>, level: &Level) -> Tensor<2> {
    let [n, _] = unit.dims();
    let cell = unit * level.cells as f32;
    let low = cell
        .clone()
        .detach()
        .floor()
        .clamp(0.0, level.cells as f32 - 1.0);
    let part = cell - low.clone();
    let axis = |t: &Tensor<2>, a: usize| t.clone().slice([0..n, a..a + 1]);
    let corner_value = |corner: u32| {
        let bit = [corner & 1, corner >> 1 & 1, corner >> 2];
        let mut share = Tensor::<2>::ones([n, 1], &low.device());
        for (a, &b) in bit.iter().enumerate() {
            let t = axis(&part, a);
            share = share * if b == 1 { t } else { t.neg().add_scalar(1.0) };
        }
        // 32-bit wrapping products are computed on the host: integer widths differ by backend.
        let nodes: Vec<f32> = low
            .clone()
            .try_into_vec_as()
            .expect("a tensor's floats in host memory");
        let rows: Vec<i64> = nodes
            .chunks_exact(3)
            .map(|p| {
                (level.offset + level.row(std::array::from_fn(|a| p[a] as u32 + bit[a]))) as i64
            })
            .collect();
        let rows = Tensor::<1, Int>::from_data(rows.as_slice(), &low.device());
        table.clone().select(0, rows) * share
    };
    (1..8).fold(corner_value(0), |sum, corner| sum + corner_value(corner))
}
