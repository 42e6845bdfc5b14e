//! Files of other programs as plain data.
//!
//! Read: bytes in, numbers and strings out. This crate has no notion of people or cameras, runs no code
//! of a file, and returns data or an error for any bytes. The importers of the client and of the
//! model interpret the numbers.
//!
//! - [`pickle`]: Python's pickles and joblib's files, read without calling anything.
//! - [`torch`]: files of `torch.save`.
//! - [`rle`]: COCO's masks as run lengths.
//! - [`npy`], [`npz`]: numpy's files of one array and of several.
//! - [`bvh`]: skeletons with motion.
//!
//! Written:
//! - [`splats`]: Gaussian splats.
//! - [`glb`]: glTF in one file.

mod array;
pub mod bvh;
mod dtype;
pub mod glb;
pub mod npy;
pub mod npz;
pub mod pickle;
pub mod rle;
pub mod splats;
pub mod torch;
mod value;

pub use array::Array;
pub use value::Value;
