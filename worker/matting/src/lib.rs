//! Mattes of people by a network that the user names: a file in ONNX, run in this process on the CPU.
//!
//! No network comes with this project. Those that the public can download differ in licence, in the
//! size and levels of the pictures that they take, and in what they give; this crate finds the form of
//! a file by its inputs and outputs ([`Form`]) and says what it can't run.
//!
//! ```text
//! picture → scaled, levels normalised → network → levels → one person, cleaned → coverage
//! ```

mod error;
mod form;
mod levels;
mod matter;
mod output;
mod person;

pub use error::MattingError;
pub use form::Form;
pub use levels::Levels;
pub use matter::{Matte, Matter};
