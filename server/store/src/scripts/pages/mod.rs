//! Reads that pages need beyond those of calls: what a page mentions is read at once, and not one row after the other.

pub mod jobs;
pub mod models;
pub mod names;
pub mod people;
#[cfg(test)]
mod tests;
