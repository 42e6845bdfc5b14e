//! The coordinator's side of the object store: uploads that grow, free space, and collection of garbage.

pub mod collect;
pub mod disk;
mod folders;
pub mod parts;
pub mod place;
pub mod room;
pub mod upload;
