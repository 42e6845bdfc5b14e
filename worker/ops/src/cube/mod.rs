//! Shared parts of the operations' `cube` forms: buffers, launch sizes and atomic sums. One source
//! compiles for Vulkan, CUDA and HIP alike.

pub(crate) mod adding;
pub(crate) mod tensors;
