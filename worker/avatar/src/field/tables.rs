//! The hash tables of a field, and which of them people share ([`Sharing`]).
//!
//! A table per identity is most of the cost of a person: in memory, in a checkpoint, and in what
//! training has to learn from scratch. People resemble each other in their canonical boxes, where
//! the same joints have nearly the same places, so two forms share entries:
//!
//! - `split`: the features of a shared table and of a smaller one per identity are *added*, not
//!   concatenated. The network stays as narrow as with one table, and an identity whose own table
//!   is zero looks like the shared person.
//! - `bases`: each entry holds R rows, and an identity has R coefficients per level. An additional
//!   person then costs L R numbers.

use crate::config::{Encoding, Sharing};
use crate::init::Initial;
use burn::module::Param;
use burn::tensor::Tensor;
use yoto_ops::hash::{self, HashGrid};

/// Initial table entries are uniform in ± this (Instant NGP).
const TABLE_BOUND: f64 = 1e-4;
/// Standard deviation of an identity's initial coefficients except the first, which is 1. The
/// other coefficients must differ from each other: with equal ones, the rows of an entry would
/// always receive the same gradient.
const MIX_STD: f64 = 0.5;

/// The parameters of a field's tables, which move into the field and are named after it.
pub(super) struct Tables {
    /// One `[rows, F]` per identity, except with bases.
    pub own: Vec<Param<Tensor<2>>>,
    /// `[rows, F]` with `split`, `[rows, R F]` with bases.
    pub shared: Option<Param<Tensor<2>>>,
    /// One `[L, R]` per identity, with bases.
    pub mixes: Vec<Param<Tensor<2>>>,
}

impl Tables {
    /// Tables for `slots` identities in the field at `path`; `grid` is the encoding's grid over
    /// any box. The Fourier encoding has none.
    ///
    /// # Panics
    /// If the encoding is a hash grid and `grid` is absent.
    pub fn new(
        init: &Initial,
        path: &str,
        encoding: &Encoding,
        grid: Option<&HashGrid>,
        slots: usize,
    ) -> Self {
        let mut tables = Self {
            own: Vec::new(),
            shared: None,
            mixes: Vec::new(),
        };
        let Encoding::Hash { sharing, .. } = encoding else {
            return tables;
        };
        let grid = grid.expect("a hash encoding comes with a grid");
        let table = |name: String, grid: &HashGrid| {
            let shape = [grid.rows(), grid.features];
            init.uniform(&format!("{path}.{name}"), shape, TABLE_BOUND)
        };
        let owns = |grid: &HashGrid| -> Vec<_> {
            (0..slots)
                .map(|slot| table(format!("tables.{slot}"), grid))
                .collect()
        };
        match *sharing {
            Sharing::Own => tables.own = owns(grid),
            Sharing::Split { own_log2_rows } => {
                tables.shared = Some(table("shared".into(), grid));
                tables.own = owns(&grid.within(own_log2_rows));
            }
            Sharing::Bases { count } => {
                tables.shared = Some(table("shared".into(), grid));
                let shape = [grid.levels.len(), count];
                tables.mixes = (0..slots)
                    .map(|slot| init.mixture(&format!("{path}.mixes.{slot}"), shape, MIX_STD))
                    .collect();
            }
        }
        tables
    }
}

/// Features `[N, L F]` of `points` `[N, 3]` in a `table` `[rows, F]`.
pub(super) fn plain(table: &Param<Tensor<2>>, points: Tensor<2>, grid: &HashGrid) -> Tensor<2> {
    hash::encode(table.val(), points, grid)
}

/// Features `[N, L F]` of `points` `[N, 3]` in `bases` `[rows, R F]` with the coefficients `mix`
/// `[L, R]`.
///
/// The encoding `[N, L R F]` is multiplied by one block-diagonal matrix `[L R F, L F]` of the
/// coefficients: scaling and summing it would write `[N, L R F]` numbers more than once.
pub(super) fn mixed(
    bases: &Param<Tensor<2>>,
    mix: &Param<Tensor<2>>,
    points: Tensor<2>,
    grid: &HashGrid,
) -> Tensor<2> {
    let (encoded, mix) = (plain(bases, points, grid), mix.val());
    let [levels, rows] = mix.dims();
    let [_, width] = encoded.dims();
    let features = width / (levels * rows);
    let device = encoded.device();
    // [L, 1, 1, L, 1] and [1, 1, F, 1, F]: ones where levels and features are equal.
    let same_level = Tensor::<2>::eye(levels, &device).reshape([levels, 1, 1, levels, 1]);
    let same_feature = Tensor::<2>::eye(features, &device).reshape([1, 1, features, 1, features]);
    let matrix = mix.reshape([levels, rows, 1, 1, 1]) * same_level * same_feature;
    encoded.matmul(matrix.reshape([width, levels * features]))
}
