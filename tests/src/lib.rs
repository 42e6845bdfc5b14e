//! What the black-box tests share: real processes that end with the test, and captures of
//! made-up people on disk.

pub mod people;
pub mod process;
