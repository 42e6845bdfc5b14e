//! Talking to a yoto service: the client library and the `yoto` command.
//!
//! - [`allocator`]: how the command holds memory.
//! - [`api`]: the service's calls, for programs.
//! - [`capture_dir`]: a capture as a folder on disk, checked before it is uploaded.
//! - [`import`]: captures and motions of other programs.
//!   (`capture_check` looks at its pictures as well.)
//! - [`progress`]: showing how a job gets on.
//! - [`commands`]: the command line.
//!
//! With the feature `embedded` (on by default) a process can also be the service it talks
//! to (`embedded`), show all of it (`demo`), and run the experiments of
//! `yoto_lab`.

pub mod allocator;
pub mod api;
#[cfg(feature = "embedded")]
pub mod capture_check;
pub mod capture_dir;
pub mod commands;
pub mod import;
pub mod progress;

#[cfg(feature = "embedded")]
pub mod demo;
#[cfg(feature = "embedded")]
pub mod embedded;
#[cfg(feature = "embedded")]
mod npz;
