//! Neural fields over canonical space: their networks, non-rigid motion and its frequency window,
//! colour and density, or the splats that take their place.

pub(crate) mod canonical;
pub(crate) mod mlp;
pub(crate) mod non_rigid;
pub(crate) mod pose_shapes;
pub mod splats;
mod tables;
pub mod window;
