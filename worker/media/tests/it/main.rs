//! Films and pictures of real encoders, in and out.

mod film;
mod video;
