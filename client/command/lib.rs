//! The `yoto` command.
//!
//! - [`cli`]: the command line, which runs the command that a user names.
//! - A folder per noun: `subject`, `model`, `job`, `key`, `render`, `export`, `scene`, `capture`, `service`.
//! - `args`: options that several commands have; `show`: text that several commands print; `files`: files that
//!   commands write; `import_progress`, `upload_files`: what imports report and read, for the terminal and for the service;
//!   `waiting`: the wait for a job.
//! - [`allocator`]: the command's allocator.
//!
//! With the feature `embedded` (on by default) a process can also contain the service
//! (`embedded`, `studio`), run the demo (`demo`), and make one person's avatar (`avatar`).

#[macro_use(detail, say, tell)]
extern crate yoto_terminal;

pub mod allocator;
pub mod cli;

mod args;
#[cfg(feature = "embedded")]
mod audit;
mod capture;
mod export;
mod files;
mod import_progress;
mod job;
mod key;
mod model;
mod motion;
mod render;
mod scene;
mod service;
mod share;
mod show;
mod subject;
mod tenant;
mod upload_files;
mod waiting;
mod webhook;

#[cfg(feature = "embedded")]
mod avatar;
#[cfg(feature = "embedded")]
mod demo;
#[cfg(feature = "embedded")]
pub mod embedded;
#[cfg(feature = "embedded")]
mod studio;
