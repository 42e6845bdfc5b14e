//! Splats: where they start, and the colours of those that no frame shows.

mod first;
mod hull;
pub(crate) mod placing;
pub(crate) mod unseen;
