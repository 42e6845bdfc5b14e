//! A model of clothed bodies, learned from bodies in dense correspondence: vertex i is the same place of every body.
//!
//! A body at rest is x(β) = x̄ + Σₖ βₖ σₖ Uₖ, [V, 3] metres, with β ~ N(0, I), and its colours are c(γ) = c̄ + Σₖ γₖ τₖ Tₖ.
//! Both are linear, so a person follows from key points and outlines in closed form. Joints are linear in the vertices.
//! The bodies wear clothes, hair and shoes, and so does the mean.
//!
//! - [`Body`]: the model.
//! - [`ExtraJoints`]: fingers and face of the model.
//! - [`mod@file`]: its file, and the one that the program has.
//! - [`learn`]: learns a model.
//! - [`person`]: one person's body, by their joints and outlines.

mod body;
mod extra_joints;
pub mod file;
pub mod learn;
mod packed;
pub mod person;
mod tensors;
#[cfg(test)]
mod tests;

pub use body::{Body, JOINTS};
pub use extra_joints::{ExtraJoints, FACE, FINGERS, WITH_FACE, WITH_FINGERS, hand_of, is_of_face};
pub use tensors::FileError;
