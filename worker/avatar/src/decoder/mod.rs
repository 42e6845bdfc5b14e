//! What people look like: a decoder of colours that all people share.
//!
//! A splat's colour is what the decoder says of its place on the body and of the person's code, plus a rest that is the
//! person's own. Where no frame shows the person, the rest is that of the surface around, and the decoder says the
//! remainder: hair behind a face, a coat's back behind its open front. The decoder is linear, μ(p) + Σᵣ zᵣ Wᵣ(p), so that
//! the code z of a person follows from what frames show in closed form, and nothing has to be trained again.
//!
//! - [`parts`]: places on the body that correspond between people.
//! - [`cells`]: the grid of places at which the decoder has values.
//! - [`linear`]: the decoder itself.
//! - [`learn`]: learns a decoder from people who were filmed from every side.
//! - [`mod@file`]: its file, and the one that the program has.
//! - `prior`: which decoder a training takes.

pub(crate) mod cells;
pub mod file;
pub mod learn;
pub(crate) mod linear;
pub(crate) mod parts;
mod prior;
#[cfg(test)]
mod tests;

pub use linear::Decoder;
pub use prior::Prior;
