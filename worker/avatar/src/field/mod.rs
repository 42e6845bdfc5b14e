//! The neural fields over canonical space: networks, non-rigid motion and how its bands open, colour
//! and density.

pub mod canonical;
pub mod mlp;
pub mod non_rigid;
mod tables;
pub mod window;
