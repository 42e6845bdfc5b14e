//! The hash tables of a field: one that people share, and a smaller one per identity.
//!
//! A table per identity is most of the cost of a person: in memory, in a checkpoint, and in what
//! training has to learn from scratch. People resemble each other in their canonical boxes, where
//! the same joints have nearly the same positions. So the features of a shared table and of a smaller one
//! per identity are *added*, not concatenated: the network stays as narrow as with one table, and an
//! identity with a table of zeros looks like the shared person.

use crate::config::Encoding;
use crate::init::Initial;
use burn::module::Param;
use burn::tensor::Tensor;
use yoto_ops::hash::{self, HashGrid};

/// Initial table entries are uniform in ± this (Instant NGP).
const TABLE_BOUND: f64 = 1e-4;

/// The parameters of a field's tables, which move into the field and are named after it.
pub(super) struct Tables {
    /// One `[rows, F]` per identity.
    pub own: Vec<Param<Tensor<2>>>,
    /// `[rows, F]`.
    pub shared: Option<Param<Tensor<2>>>,
}

impl Tables {
    /// Tables for `slots` identities in the field at `path`; `grid` is the encoding's grid over
    /// any box. The Fourier encoding has none.
    ///
    /// # Panics
    /// If the encoding is a hash grid and `grid` is absent.
    pub(super) fn new(
        init: &Initial,
        path: &str,
        encoding: &Encoding,
        grid: Option<&HashGrid>,
        slots: usize,
    ) -> Self {
        let Encoding::Hash { own_log2_rows, .. } = encoding else {
            return Self {
                own: Vec::new(),
                shared: None,
            };
        };
        let grid = grid.expect("a hash encoding comes with a grid");
        let table = |name: String, grid: &HashGrid| {
            let shape = [grid.rows(), grid.features];
            init.uniform(&format!("{path}.{name}"), shape, TABLE_BOUND)
        };
        let own_grid = grid.within(*own_log2_rows);
        Self {
            own: (0..slots)
                .map(|slot| table(format!("tables.{slot}"), &own_grid))
                .collect(),
            shared: Some(table("shared".into(), grid)),
        }
    }
}

/// Features `[N, L F]` of `points` `[N, 3]` in a `table` `[rows, F]`.
pub(super) fn encode(table: &Param<Tensor<2>>, points: Tensor<2>, grid: &HashGrid) -> Tensor<2> {
    hash::encode(table.val(), points, grid)
}
