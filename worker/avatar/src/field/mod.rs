//! Neural fields over canonical space: their networks, non-rigid motion and its frequency window,
//! colour and density.

pub mod canonical;
pub mod mlp;
pub mod non_rigid;
mod tables;
pub mod window;
