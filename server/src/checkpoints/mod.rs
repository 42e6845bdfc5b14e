//! Which checkpoints of a model are used, and which are kept: pure rules, which the store applies inside its transactions and
//! the API explains. And what the manifest of one may name.

pub mod best;
pub mod manifest;
pub mod retention;
