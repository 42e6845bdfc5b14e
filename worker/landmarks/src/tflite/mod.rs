//! Reader of TensorFlow Lite models: flatbuffers with float weights of 32 or 16 bits, dense or sparse.
//!
//! ```text
//! bytes (tables of a flatbuffer) → constants (weights as f32) ┐
//!                                → kind (operators, options) ─┴→ graph
//! ```

mod bytes;
mod constants;
mod graph;
mod kind;

#[cfg(test)]
pub(crate) mod writer;

pub(crate) use constants::Constant;
pub(crate) use graph::{Graph, Operator};
pub(crate) use kind::{Activation, OperatorKind, Padding, Window};
