//! Reads uploads into pictures: stills, videos, archives, masks.
//!
//! ```text
//! archive ─► files on disk ─► sniff ─► still ┐
//!                                └──► video ─┴─► Picture ─► lens ─► compose with a mask
//! ```
//!
//! Also writes pictures: as [`png`] files, still or animated, as a [`film`], and on disk ([`picture_file`]).
//!
//! No network, no tensors, no async. Input is untrusted: sizes are compared with [`Limits`]
//! before anything is allocated, and an error is a [`MediaFault`] with a code and a message, to which
//! the caller adds file and frame. Total memory and time are limited from outside: the service
//! runs this code in a child process.

pub mod archive;
pub mod backdrop;
pub mod compose;
pub mod edge;
mod fault;
pub mod film;
pub mod lens;
mod limits;
pub mod mask;
mod orientation;
mod picture;
pub mod picture_file;
pub mod png;
pub mod sniff;
pub mod source;
mod still;
pub mod video;

pub use fault::{MEMORY_LIMIT, MediaError, MediaFault};
pub use limits::Limits;
pub use orientation::Orientation;
pub use picture::Picture;
pub use still::{decode_still, still_size};
