//! Reading and writing the files of real encoders.

mod film;
mod hdr;
mod video;
