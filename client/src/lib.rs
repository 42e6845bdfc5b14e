//! The client library of a yoto service, and the `yoto` command.
//!
//! - [`allocator`]: the command's allocator.
//! - [`api`]: the service's calls, for programs.
//! - [`capture_dir`]: a capture as a folder on disk, before it is uploaded.
//! - [`capture_check`]: whether its poses, cameras, masks and pictures agree.
//! - [`import`]: captures and motions of other programs.
//! - [`output`]: results for people and for programs.
//! - [`progress`]: the progress of jobs on a terminal.
//! - [`commands`]: the command line.
//!
//! With the feature `embedded` (on by default) a process can also contain the service
//! (`embedded`, `studio`), run the demo (`demo`), make one person's avatar (`avatar`), and run the
//! experiments of `yoto_lab`.

#[macro_use]
pub mod output;

pub mod allocator;
pub mod api;
pub mod capture_check;
pub mod capture_dir;
pub mod commands;
pub mod import;
pub mod progress;

#[cfg(feature = "embedded")]
pub mod avatar;
#[cfg(feature = "embedded")]
pub mod demo;
#[cfg(feature = "embedded")]
pub mod embedded;
#[cfg(feature = "embedded")]
mod npz;
#[cfg(feature = "embedded")]
pub mod studio;
