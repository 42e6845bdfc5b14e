//! The service itself: run it, run workers for it, see its status, remove its garbage.

#[cfg(feature = "embedded")]
pub(crate) mod adopt;
#[cfg(feature = "embedded")]
pub(crate) mod backup;
#[cfg(feature = "embedded")]
pub(crate) mod config;
pub(crate) mod drain;
#[cfg(feature = "embedded")]
pub(crate) mod erased;
#[cfg(feature = "embedded")]
mod exposure;
#[cfg(feature = "embedded")]
pub(crate) mod fsck;
pub(crate) mod gc;
pub(crate) mod logs;
#[cfg(feature = "embedded")]
mod open_files;
#[cfg(feature = "embedded")]
pub(crate) mod serve;
#[cfg(feature = "embedded")]
pub(crate) mod signals;
#[cfg(feature = "embedded")]
mod signed_urls;
#[cfg(feature = "embedded")]
mod state;
pub(crate) mod status;
#[cfg(feature = "embedded")]
mod telemetry;
pub(crate) mod worker;
