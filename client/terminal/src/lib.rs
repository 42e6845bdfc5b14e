//! What commands show: results on stdout, notes and progress on stderr.
//!
//! - [`args`]: options that the commands of both programs have.
//! - [`output`]: results for people and for programs, and notes.
//! - [`progress`]: the progress of jobs and other activities.
//! - [`table`], [`scores`], [`chart`]: tables and curves.

#[macro_use]
pub mod output;
pub mod args;
pub mod chart;
pub mod progress;
pub mod scores;
pub mod table;
