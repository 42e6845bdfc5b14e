//! Trained people in forms that other programs play.
//!
//! - [`gaussians`]: a person in one pose as Gaussians in space, for files of splats.
//! - [`page`]: a page that plays a person in a browser, in one file.
//! - [`mesh`]: a person as a mesh with a texture and bones.
//! - [`clip`]: the motion that they play.

pub mod clip;
pub mod gaussians;
pub mod mesh;
pub mod page;
mod shine;
