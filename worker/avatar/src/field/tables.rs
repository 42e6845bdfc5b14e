//! The hash tables of a field, and what of them people share ([`Sharing`]).
//!
//! A table an identity is most of what a person costs: in memory, in a checkpoint, and in what a
//! new person has to learn from nothing. People are alike in much (a box of the same build
//! around the same joints), so two forms share it:
//!
//! - `split`: features of everybody's table and of a smaller one of the identity's are *added*,
//!   not concatenated. The network behind stays as narrow as with one table, which is what a
//!   step's time hangs on, and an own table that is nothing leaves the shared person.
//! - `bases`: each entry holds R rows, and an identity is R coefficients a level. A further
//!   person then costs L R numbers.

use crate::config::{Encoding, Sharing};
use crate::init::Initial;
use crate::ops::hash::{self, HashGrid};
use burn::module::Param;
use burn::tensor::Tensor;

/// Table entries start uniform in ± this (Instant NGP).
const TABLE_BOUND: f64 = 1e-4;
/// Deviation of an identity's coefficients but the first, which starts as 1: everybody is the
/// mean, plus something in directions that must differ from the start. Were all alike, the rows
/// of an entry would get the same gradient for ever.
const MIX_DEVIATION: f64 = 0.5;

/// The parameters of a field's tables, as the field holds them: their names are the field's.
pub(super) struct Tables {
    /// One `[rows, F]` an identity.
    pub own: Vec<Param<Tensor<2>>>,
    /// `[rows, F]`, or `[rows, R F]` with bases.
    pub shared: Option<Param<Tensor<2>>>,
    /// One `[L, R]` an identity, with bases.
    pub mixes: Vec<Param<Tensor<2>>>,
}

impl Tables {
    /// For the parts of the field at `path` that `encoding` has; `grid` is the encoding's over
    /// any box.
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
        let (Encoding::Hash { sharing, .. }, Some(grid)) = (encoding, grid) else {
            return tables;
        };
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
                    .map(|slot| init.mixture(&format!("{path}.mixes.{slot}"), shape, MIX_DEVIATION))
                    .collect();
            }
        }
        tables
    }
}

/// Features `[N, L F]` of `points` `[N, 3]` for the identity in `slot`, which has what `encoding`
/// says.
pub(super) fn encode(
    encoding: &Encoding,
    own: Option<&Param<Tensor<2>>>,
    shared: Option<&Param<Tensor<2>>>,
    mix: Option<&Param<Tensor<2>>>,
    points: Tensor<2>,
    grid: &HashGrid,
) -> Option<Tensor<2>> {
    let Encoding::Hash { sharing, .. } = encoding else {
        return None;
    };
    Some(match *sharing {
        Sharing::Own => hash::encode(own?.val(), points, grid),
        Sharing::Split { own_log2_rows } => {
            let of_all = hash::encode(shared?.val(), points.clone(), grid);
            of_all + hash::encode(own?.val(), points, &grid.within(own_log2_rows))
        }
        Sharing::Bases { .. } => mixed(hash::encode(shared?.val(), points, grid), mix?.val()),
    })
}

/// `[N, L R F]` mixed by `[L, R]` → `[N, L F]`, as one product with a matrix that holds the
/// coefficients where level meets level and feature meets feature: multiplying and summing would
/// write `[N, L R F]` numbers more than once.
fn mixed(encoded: Tensor<2>, mix: Tensor<2>) -> Tensor<2> {
    let [levels, rows] = mix.dims();
    let [_, width] = encoded.dims();
    let features = width / (levels * rows).max(1);
    let device = encoded.device();
    // [L, 1, 1, L, 1] and [1, 1, F, 1, F]: where a level meets itself, a feature itself.
    let same_level = Tensor::<2>::eye(levels, &device).reshape([levels, 1, 1, levels, 1]);
    let same_feature = Tensor::<2>::eye(features, &device).reshape([1, 1, features, 1, features]);
    let matrix = mix.reshape([levels, rows, 1, 1, 1]) * same_level * same_feature;
    encoded.matmul(matrix.reshape([width, levels * features]))
}
