//! The format of the factors of matrix products.

use serde::{Deserialize, Serialize};

/// Format to which the factors of the products in the canonical and the non-rigid network are rounded.
/// Sums, biases, results, parameters and everything outside of these networks are f32.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Precision {
    /// No rounding.
    #[default]
    F32,
    /// bf16, with 8 significant bits; only on CPUs. Products take about half the time on CPUs with
    /// instructions for them (docs/research/performance.md).
    Bf16,
}
