//! Files of other programs as plain data.
//!
//! Bytes in, numbers and texts out: nothing here knows what a person or a camera is, nothing
//! runs what a file says, and whatever the bytes are, the answer is data or an error. What the
//! numbers mean is known one floor up, by the importers of the client and of the model.
//!
//! - [`pickle`]: Python's pickles, read by a machine that calls nothing.
//! - [`npy`], [`npz`]: numpy's files of one array and of several.
//! - [`bvh`]: skeletons with motion.

mod array;
pub mod bvh;
mod dtype;
pub mod npy;
pub mod npz;
pub mod pickle;
mod value;

pub use array::Array;
pub use value::Value;
