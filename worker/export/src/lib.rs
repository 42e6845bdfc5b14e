//! Trained people in formats for other programs.
//!
//! - [`gaussians`]: a person in one pose as Gaussians in space, for files of splats.
//! - [`page`]: a page that plays a person in a browser, in one file.
//! - [`mesh`]: a person as a mesh with a texture and bones.
//! - [`clip`]: a motion of a person.
//! - [`source`]: motions of captures and files, before they are transferred to a person's body.
//! - [`order`]: an export with all of its files.

pub mod clip;
pub mod gaussians;
pub mod mesh;
pub mod order;
pub mod page;
mod rights;
mod shine;
pub mod source;
