//! Files of other programs as plain data.
//!
//! Readers turn bytes into numbers and strings. They know nothing of people or cameras, run no code of a file, and
//! return data or an error for any bytes. The client's and the model's importers interpret the data.
//!
//! - [`pickle`]: Python's pickles and joblib's files, read without calling anything.
//! - [`torch`]: files of `torch.save`.
//! - [`rle`]: COCO's masks as run lengths.
//! - [`npy`], [`npz`]: numpy's files of one array and of several.
//! - [`bvh`]: skeletons with motion.
//!
//! Writers:
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
