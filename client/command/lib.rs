//! The `yoto` command.
//!
//! - [`commands`]: the command line.
//! - [`allocator`]: the command's allocator.
//!
//! With the feature `embedded` (on by default) a process can also contain the service
//! (`embedded`, `studio`), run the demo (`demo`), and make one person's avatar (`avatar`).

#[macro_use(say, tell)]
extern crate yoto_terminal;

pub mod allocator;
pub mod commands;

#[cfg(feature = "embedded")]
pub mod avatar;
#[cfg(feature = "embedded")]
pub mod demo;
#[cfg(feature = "embedded")]
pub mod embedded;
#[cfg(feature = "embedded")]
pub mod studio;
