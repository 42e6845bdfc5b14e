//! The neural fields over canonical space: encodings, networks, non-rigid motion, colour and
//! density.

pub mod canonical;
pub mod encoding;
pub mod mlp;
pub mod non_rigid;
mod tables;
