//! Trained people in forms that other programs play.
//!
//! - [`gaussians`]: a person in one pose as Gaussians in space, for files of splats.
//! - [`page`]: a page that plays a person in a browser, in one file.
//! - [`clip`]: the motion that it plays.

pub mod clip;
pub mod gaussians;
pub mod page;
