//! What the black-box tests share: real processes that end with the test, captures and films of
//! made-up people on disk.

pub mod film;
pub mod people;
pub mod process;
pub mod upload;
