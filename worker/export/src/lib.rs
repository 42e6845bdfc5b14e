//! Trained people in forms that other programs play.
//!
//! - [`gaussians`]: a person in one pose as Gaussians in space, for files of splats.
//! - [`page`]: a page that plays a person in a browser, in one file.
//! - [`mesh`]: a person as a mesh with a texture and bones.
//! - [`clip`]: the motion that they play.
//! - [`source`]: motions of captures and files, before anybody's body takes them.
//! - [`order`]: a form with all of its files.

pub mod clip;
pub mod gaussians;
pub mod mesh;
pub mod order;
pub mod page;
mod shine;
pub mod source;
