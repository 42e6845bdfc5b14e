//! Reads that pages need beyond those of calls: what a page mentions is read at once, and not one row after the other.

pub(crate) mod jobs;
pub(crate) mod models;
pub(crate) mod names;
pub(crate) mod people;
#[cfg(test)]
mod tests;
