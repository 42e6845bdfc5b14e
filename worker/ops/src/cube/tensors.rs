//! Tensors, buffers and launch sizes that the kernels share. Kernels see plain rows of `f32`.

use burn::tensor::{DType, Shape};
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::ops::numeric::{empty_device_dtype, zeros_client};
use burn_cubecl::tensor::CubeTensor;
use cubecl::calculate_cube_count_elemwise;
use cubecl::prelude::*;

/// The tensor's numbers row after row, without gaps.
///
/// # Panics
/// If the tensor is not of `f32`: no other type reaches the operations.
pub(crate) fn rows(tensor: CubeTensor) -> CubeTensor {
    assert_eq!(tensor.dtype, DType::F32, "the kernels compute in f32");
    into_contiguous(tensor)
}

/// A new tensor of undefined numbers on the device of `beside`.
pub(crate) fn empty(beside: &CubeTensor, shape: Shape) -> CubeTensor {
    // As one row: several rows may be padded.
    let flat = Shape::new([shape.num_elements()]);
    let (client, device) = (beside.client.clone(), beside.device.clone());
    shaped(empty_device_dtype(client, device, flat, DType::F32), shape)
}

/// A new tensor of zeros on the device of `beside`.
pub(crate) fn zeros(beside: &CubeTensor, shape: Shape) -> CubeTensor {
    let flat = Shape::new([shape.num_elements()]);
    let (client, device) = (beside.client.clone(), beside.device.clone());
    shaped(zeros_client(client, device, flat, DType::F32), shape)
}

fn shaped(flat: CubeTensor, shape: Shape) -> CubeTensor {
    CubeTensor::new_contiguous(flat.client, flat.device, shape, flat.handle, flat.dtype)
}

/// Numbers of the host as a kernel's argument.
pub(crate) fn upload<E: CubeElement>(client: &Client, values: &[E]) -> BufferArg {
    let handle = client.create_from_slice(E::as_bytes(values));
    // SAFETY: the buffer was made from exactly these values.
    unsafe { BufferArg::from_raw_parts(handle, values.len()) }
}

/// Launch size of at least `threads` threads; kernels end the surplus ones.
pub(crate) fn each(client: &Client, threads: usize) -> (CubeCount, CubeDim) {
    let dim = CubeDim::new(client, threads);
    (calculate_cube_count_elemwise(client, threads, dim), dim)
}
