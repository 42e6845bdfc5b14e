//! The service itself: run it, run workers for it, see its status, remove its garbage.

pub(crate) mod gc;
pub(crate) mod logs;
#[cfg(feature = "embedded")]
pub(crate) mod serve;
pub(crate) mod status;
#[cfg(feature = "embedded")]
pub(crate) mod worker;
