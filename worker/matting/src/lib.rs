//! Mattes of people by a network of the user's choice: an ONNX file, run in this process on the CPU.
//!
//! This project comes without a network. Public networks differ in licence, in the size and levels of their input
//! pictures, and in their outputs. This crate finds the form of a file from its inputs and outputs ([`ModelForm`]), and
//! reports files that it can't run.
//!
//! ```text
//! picture → scaled, levels normalised → network → levels → one person, cleaned → coverage
//! ```

mod error;
mod form;
mod levels;
mod load;
mod matter;
mod output;
mod person;

pub use error::MattingError;
pub use form::ModelForm;
pub use levels::Levels;
pub use matter::{Matte, Matter};
