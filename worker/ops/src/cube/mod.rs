//! What the operations' `cube` forms share: buffers, launch sizes and atomic sums. One source
//! compiles for Vulkan, CUDA and HIP alike.

pub(crate) mod adding;
pub(crate) mod tensors;
