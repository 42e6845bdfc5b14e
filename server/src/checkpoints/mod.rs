//! Which checkpoints of a model are used, and which are kept. Pure rules: the store applies them inside
//! its transactions, the API explains them.

pub mod best;
pub mod retention;
