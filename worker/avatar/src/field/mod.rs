//! Neural fields over canonical space: their networks, non-rigid motion and its frequency window,
//! colour and density.

pub(crate) mod canonical;
pub(crate) mod mlp;
pub(crate) mod non_rigid;
mod tables;
pub mod window;
