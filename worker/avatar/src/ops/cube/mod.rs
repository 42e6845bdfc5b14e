//! What the operations' `cube` forms share: buffers, launch sizes and atomic sums. One source
//! compiles for Vulkan, CUDA and HIP alike.

pub(in crate::ops) mod adding;
pub(in crate::ops) mod tensors;
