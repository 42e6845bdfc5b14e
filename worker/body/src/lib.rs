//! A model of clothed bodies, learned from bodies in dense correspondence: vertex i is the same place of every body.
//!
//! A body at rest is x(β) = x̄ + Σₖ βₖ σₖ Uₖ, [V, 3] metres, with β ~ N(0, I), and its colours are c(γ) = c̄ + Σₖ γₖ τₖ Tₖ.
//! Both are linear, so a person follows from key points and outlines in closed form. Joints are linear in the vertices.
//! The bodies wear clothes, hair and shoes, and so does the mean.
//!
//! - [`Body`]: the model.
//! - [`Fingers`]: the fingers of the model.
//! - [`mod@file`]: its file, and the one that the program has.
//! - [`learn`]: learns a model.
//! - [`person`]: one person's body, by their joints and outlines.

mod body;
pub mod file;
mod fingers;
pub mod learn;
mod packed;
pub mod person;
mod tensors;
#[cfg(test)]
mod tests;

pub use body::{Body, JOINTS};
pub use fingers::{FINGERS, Fingers, WITH_FINGERS, hand_of};
pub use tensors::FileError;
