//! Splats: where they start, how they become more, and the colours of those that no frame shows.

mod error;
mod first;
mod hull;
pub(crate) mod placing;
mod shown;
mod split;
mod surface;
pub(crate) mod unseen;
