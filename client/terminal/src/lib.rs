//! What commands show: results on stdout, notes and progress on stderr.
//!
//! - [`output`]: results for people and for programs, and notes.
//! - [`progress`]: the progress of jobs and other activities.

#[macro_use]
pub mod output;
pub mod progress;
