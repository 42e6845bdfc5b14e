//! The warp on a GPU. Forward, there is a thread per point; backward, a group of threads per bone and run of
//! points, so that the twelve sums of a bone's transform are computed in the group before they are added to
//! those of other groups.

use super::cube_grid::{Lattice, lattice, tap, transformed_point, voxels};
use super::{MIN_WEIGHT_SUM, WarpGrid, WarpOps};
use crate::cube::adding::{AddFloat, Bound, launch_adding};
use crate::cube::tensors::{each, empty, rows, zeros};
use burn::backend::tensor::FloatTensor;
use burn::tensor::Shape;
use burn_cubecl::CubeBackend;
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;
use cubecl::server::Handle;

/// Threads per group of the backward pass. Every Vulkan device runs 128; they weight 6 KiB.
const GROUP: usize = 128;
/// Points that a group sums over for its bone: enough that few groups add to the same sums.
const RUN: usize = 1024;

impl WarpOps for CubeBackend {
    fn warp(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grid: WarpGrid,
    ) -> FloatTensor<Self> {
        forward(weights, transforms, points, &grid)
    }

    fn warp_backward(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        grid: WarpGrid,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        backward(weights, transforms, points, grad, &grid)
    }
}

/// `[N, 4]` as in [`super::warp`].
fn forward(
    weights: CubeTensor,
    transforms: CubeTensor,
    points: CubeTensor,
    grid: &WarpGrid,
) -> CubeTensor {
    let (weights, transforms, points) = (rows(weights), rows(transforms), rows(points));
    let output = empty(&points, super::output_shape(points.meta.shape()));
    let client = output.client.clone();
    let n = points.meta.shape()[0];
    if n > 0 {
        let supports = Supports::find(&weights, &transforms, grid);
        let (count, dim) = each(&client, n);
        warp_points::launch(
            &client,
            count,
            dim,
            weights.into_buffer_arg(),
            transforms.into_buffer_arg(),
            points.into_buffer_arg(),
            supports.argument(),
            output.clone().into_buffer_arg(),
            lattice(grid),
        );
    }
    output
}

/// Gradients to weights (same shape) and transforms `[K, 12]`, from `grad` `[N, 4]`.
fn backward(
    weights: CubeTensor,
    transforms: CubeTensor,
    points: CubeTensor,
    grad: CubeTensor,
    grid: &WarpGrid,
) -> (CubeTensor, CubeTensor) {
    let (weights, transforms) = (rows(weights), rows(transforms));
    let (points, grad) = (rows(points), rows(grad));
    let to_weights = zeros(&weights, weights.meta.shape().clone());
    let to_transforms = zeros(&weights, transforms.meta.shape().clone());
    let client = points.client.clone();
    let (n, bones) = (points.meta.shape()[0], transforms.meta.shape()[0]);
    if n > 0 {
        let supports = Supports::find(&weights, &transforms, grid);
        let blend_terms = empty(&points, Shape::new([n, 2]));
        let (count, dim) = each(&client, n);
        blend_backward::launch(
            &client,
            count,
            dim,
            weights.clone().into_buffer_arg(),
            transforms.clone().into_buffer_arg(),
            points.clone().into_buffer_arg(),
            supports.argument(),
            grad.clone().into_buffer_arg(),
            blend_terms.clone().into_buffer_arg(),
            lattice(grid),
        );
        launch_adding!(
            bones_backward,
            &client,
            CubeCount::new_2d(n.div_ceil(RUN) as u32, bones as u32),
            CubeDim::new_1d(GROUP as u32),
            weights.into_buffer_arg(),
            transforms.into_buffer_arg(),
            points.into_buffer_arg(),
            supports.argument(),
            grad.into_buffer_arg(),
            blend_terms.into_buffer_arg(),
            to_weights.clone().into_buffer_arg(),
            to_transforms.clone().into_buffer_arg(),
            lattice(grid),
        );
    }
    (to_weights, to_transforms)
}

/// The lowest and highest nodes where each bone has a weight above the floor, on the device:
/// `[K, 6]` x y z, x y z. Points more than a cell outside are left out.
struct Supports {
    handle: Handle,
    numbers: usize,
}

impl Supports {
    fn find(weights: &CubeTensor, transforms: &CubeTensor, grid: &WarpGrid) -> Self {
        let bones = transforms.meta.shape()[0];
        let [across, down, deep] = grid.nodes;
        // An empty range for bones without weights.
        let nothing = [across as u32, down as u32, deep as u32, 0, 0, 0].repeat(bones);
        let client = &weights.client;
        let supports = Self {
            handle: client.create_from_slice(u32::as_bytes(&nothing)),
            numbers: nothing.len(),
        };
        let lines = bones * down * deep;
        let (count, dim) = each(client, lines);
        find_supports::launch(
            client,
            count,
            dim,
            weights.clone().into_buffer_arg(),
            supports.argument(),
            grid.floor,
            lines,
            across,
            down,
            deep,
        );
        supports
    }

    fn argument(&self) -> BufferArg {
        // SAFETY: `find` made the buffer of this many numbers.
        unsafe { BufferArg::from_raw_parts(self.handle.clone(), self.numbers) }
    }
}

/// Finds the [`Supports`]. A thread per line of nodes along x.
#[cube(launch)]
fn find_supports(
    weights: &[f32],
    supports: &mut [Atomic<u32>],
    floor: f32,
    lines: usize,
    across: usize,
    down: usize,
    deep: usize,
) {
    let line = ABSOLUTE_POS;
    if line >= lines {
        terminate!();
    }
    let mut found = false;
    let mut first = 0u32;
    let mut last = 0u32;
    for x in 0..across {
        if weights[line * across + x] > floor {
            last = x as u32;
            if !found {
                first = last;
            }
            found = true;
        }
    }
    if found {
        let y = (line % down) as u32;
        let z = (line / down % deep) as u32;
        let at = line / (down * deep) * 6;
        supports[at].fetch_min(first);
        supports[at + 1].fetch_min(y);
        supports[at + 2].fetch_min(z);
        supports[at + 3].fetch_max(last);
        supports[at + 4].fetch_max(y);
        supports[at + 5].fetch_max(z);
    }
}

/// Writes `[N, 4]` as the operation `warp` does. A thread per point.
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
fn warp_points(
    weights: &[f32],
    transforms: &[f32],
    points: &[f32],
    supports: &[u32],
    output: &mut [f32],
    lattice: &Lattice,
) {
    let i = ABSOLUTE_POS;
    if i >= points.len() / 3 {
        terminate!();
    }
    let sums = blend_sums(weights, transforms, points, supports, i, lattice);
    // c = Σ wₖ pₖ / max(Σ wₖ, ε), m = clamp(Σ wₖ, 0, 1)
    let divisor = max(sums.sum, MIN_WEIGHT_SUM);
    output[4 * i] = sums.x / divisor;
    output[4 * i + 1] = sums.y / divisor;
    output[4 * i + 2] = sums.z / divisor;
    output[4 * i + 3] = clamp(sums.sum, 0.0, 1.0);
}

/// Σ wₖ pₖ and Σ wₖ over the bones k at a point.
#[derive(CubeType, Clone, Copy)]
struct BlendSums {
    /// Σ w p.
    x: f32,
    y: f32,
    z: f32,
    /// Σ w.
    sum: f32,
}

#[cube]
fn blend_sums(
    weights: &[f32],
    transforms: &[f32],
    points: &[f32],
    supports: &[u32],
    i: usize,
    lattice: &Lattice,
) -> BlendSums {
    let voxels = voxels(lattice);
    let mut x = 0.0f32;
    let mut y = 0.0f32;
    let mut z = 0.0f32;
    let mut sum = 0.0f32;
    for bone in 0..transforms.len() / 12 {
        let point = transformed_point(transforms, points, supports, bone, i, lattice);
        if point.inside {
            let volume = bone * voxels;
            let mut w = 0.0f32;
            for corner in 0..8u32 {
                let tap = tap(&point, corner, lattice);
                if tap.inside {
                    w += tap.u * tap.v * tap.w * weights[volume + tap.node];
                }
            }
            x += w * point.x;
            y += w * point.y;
            z += w * point.z;
            sum += w;
        }
    }
    BlendSums { x, y, z, sum }
}

/// Writes the part of a point's gradient that all bones share, `[N, 2]`: 1 / s with s = max(Σ wₖ, ε), and the
/// gradient to every weight through the sums s and m. Both are 0 where the gradient to the result is exactly
/// zero.
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
fn blend_backward(
    weights: &[f32],
    transforms: &[f32],
    points: &[f32],
    supports: &[u32],
    grad: &[f32],
    output: &mut [f32],
    lattice: &Lattice,
) {
    let i = ABSOLUTE_POS;
    if i >= points.len() / 3 {
        terminate!();
    }
    let gx = grad[4 * i];
    let gy = grad[4 * i + 1];
    let gz = grad[4 * i + 2];
    let gm = grad[4 * i + 3];
    // c = Σ wₖ pₖ / s: ∂L/∂s = −∂L/∂c · c / s; m = clamp(Σ wₖ, 0, 1)
    let mut inverse = 0.0f32;
    let mut to_sum = 0.0f32;
    if gx != 0.0 || gy != 0.0 || gz != 0.0 || gm != 0.0 {
        let sums = blend_sums(weights, transforms, points, supports, i, lattice);
        inverse = 1.0 / max(sums.sum, MIN_WEIGHT_SUM);
        if sums.sum > MIN_WEIGHT_SUM {
            to_sum = -(gx * sums.x + gy * sums.y + gz * sums.z) * inverse * inverse;
        }
        if sums.sum >= 0.0 && sums.sum <= 1.0 {
            to_sum += gm;
        }
    }
    output[2 * i] = inverse;
    output[2 * i + 1] = to_sum;
}

/// Adds the gradients to weights and transforms. A group of threads per run of points (x) and bone (y).
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
fn bones_backward<A: AddFloat>(
    weights: &[f32],
    transforms: &[f32],
    points: &[f32],
    supports: &[u32],
    grad: &[f32],
    blend_terms: &[f32],
    to_weights: &mut [Atomic<Bound<A>>],
    to_transforms: &mut [Atomic<Bound<A>>],
    lattice: &Lattice,
) {
    let n = points.len() / 3;
    let bone = CUBE_POS_Y as usize;
    let volume = bone * voxels(lattice);
    let unit = UNIT_POS as usize;
    let first = CUBE_POS_X as usize * RUN;
    let mut own = Array::<f32>::new(12usize);
    #[unroll]
    for k in 0..12usize {
        own[k] = 0.0;
    }
    for step in 0..RUN / GROUP {
        let i = first + step * GROUP + unit;
        let mut inverse = 0.0f32;
        if i < n {
            inverse = blend_terms[2 * i];
        }
        if inverse != 0.0 {
            let point = transformed_point(transforms, points, supports, bone, i, lattice);
            if point.inside {
                let gx = grad[4 * i];
                let gy = grad[4 * i + 1];
                let gz = grad[4 * i + 2];
                // ∂L/∂wₖ = ∂L/∂c · pₖ / s + ∂L/∂s + ∂L/∂m
                let to_weight =
                    (gx * point.x + gy * point.y + gz * point.z) * inverse + blend_terms[2 * i + 1];
                let mut w = 0.0f32;
                let mut slope_x = 0.0f32;
                let mut slope_y = 0.0f32;
                let mut slope_z = 0.0f32;
                for corner in 0..8u32 {
                    let tap = tap(&point, corner, lattice);
                    if tap.inside {
                        let value = weights[volume + tap.node];
                        w += tap.u * tap.v * tap.w * value;
                        slope_x += tap.du * tap.v * tap.w * value;
                        slope_y += tap.u * tap.dv * tap.w * value;
                        slope_z += tap.u * tap.v * tap.dw * value;
                        A::add(
                            &mut to_weights[volume + tap.node],
                            tap.u * tap.v * tap.w * to_weight,
                        );
                    }
                }
                let weight = w * inverse;
                // ∂L/∂pₖ = wₖ / s ∂L/∂c + ∂L/∂wₖ ∇Wₖ(pₖ); pₖ = Rₖ x + tₖ: ∂L/∂Rₖ = ∂L/∂pₖ xᵀ, ∂L/∂tₖ = ∂L/∂pₖ
                let to_x = weight * gx + to_weight * slope_x * lattice.scale_x;
                let to_y = weight * gy + to_weight * slope_y * lattice.scale_y;
                let to_z = weight * gz + to_weight * slope_z * lattice.scale_z;
                #[unroll]
                for c in 0..3usize {
                    let at = points[3 * i + c];
                    own[c] += to_x * at;
                    own[4 + c] += to_y * at;
                    own[8 + c] += to_z * at;
                }
                own[3usize] += to_x;
                own[7usize] += to_y;
                own[11usize] += to_z;
            }
        }
    }
    let mut shared = Shared::<[f32]>::new_slice(12 * GROUP);
    #[unroll]
    for k in 0..12usize {
        shared[k * GROUP + unit] = own[k];
    }
    sync_cube();
    if unit < 12 {
        let mut sum = 0.0f32;
        for other in 0..GROUP {
            sum += shared[unit * GROUP + other];
        }
        A::add(&mut to_transforms[12 * bone + unit], sum);
    }
}
