//! What callers share, and who may have how much of it: nobody can hold up the others.

mod bucket;
mod owner;
mod pool;
mod table;

pub(crate) use bucket::{Bucket, Filling};
pub(crate) use owner::Owner;
pub(crate) use pool::{NoPlace, Places, Pool};
pub use table::capacity_table;
