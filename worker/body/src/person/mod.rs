//! One person's body: the body's surface in their rest pose, in their shape, and their offset from it.

pub mod fit;
pub mod mesh;
pub mod offset;
pub mod rest;
pub mod sample;
pub mod shape;
pub mod visible;
