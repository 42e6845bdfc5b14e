//! The `yoto` command.
//!
//! - [`commands`]: the command line.
//! - [`allocator`]: the command's allocator.
//!
//! With the feature `embedded` (on by default) a process can also contain the service
//! (`embedded`, `studio`), run the demo (`demo`), make one person's avatar (`avatar`), and run the
//! experiments of `yoto_lab`.

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
mod npz;
#[cfg(feature = "embedded")]
mod screen;
#[cfg(feature = "embedded")]
pub mod studio;
