//! The frame of each step, and its loss.

pub mod batch;
pub(crate) mod order;
pub(crate) mod patches;
pub(crate) mod whole_picture;
