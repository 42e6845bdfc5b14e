//! Inside a kernel: rigid transforms of bones, and the gradients to them. The counterpart of `influences`.

use crate::cube::adding::{AddFloat, Bound};
use cubecl::prelude::*;

/// Threads per group that sums the gradient to a bone. Every Vulkan device runs 128; they share 6 KiB.
pub(super) const GROUP: usize = 128;
/// Points that a group sums over for its bone: enough that few groups add to the same sums.
pub(super) const RUN: usize = 1024;

/// Canonical to posed of the bone with index `bone`, row-major 3x4: [Rᵀ, −Rᵀ t] of [R, t].
#[cube]
pub(super) fn bone_to_posed(transforms: &[f32], bone: usize) -> Array<f32> {
    let t = 12 * bone;
    let mut bone_to_posed = Array::<f32>::new(12usize);
    #[unroll]
    for row in 0..3usize {
        let mut shift = 0.0f32;
        #[unroll]
        for column in 0..3usize {
            let rotation = transforms[t + 4 * column + row];
            bone_to_posed[4 * row + column] = rotation;
            shift += rotation * transforms[t + 4 * column + 3];
        }
        bone_to_posed[4 * row + 3] = -shift;
    }
    bone_to_posed
}

/// The inner product of row `i` of `grad` `[N, 12]` and a transform.
#[cube]
pub(super) fn product(grad: &[f32], i: usize, transform: &Array<f32>) -> f32 {
    let mut sum = 0.0f32;
    #[unroll]
    for k in 0..12usize {
        sum += grad[12 * i + k] * transform[k];
    }
    sum
}

/// Adds the gradient to the posed-to-canonical transform of the bone with index `bone`, from the parts `own` `[12]` of
/// the gradient to its inverse that the threads of a group of [`GROUP`] have. All of them must call this.
#[cube]
pub(super) fn rigid_inverse_backward<A: AddFloat>(
    own: &Array<f32>,
    transforms: &[f32],
    bone: usize,
    to_transforms: &mut [Atomic<Bound<A>>],
) {
    let unit = UNIT_POS as usize;
    let mut shared = Shared::<[f32]>::new_slice(12 * GROUP);
    #[unroll]
    for k in 0..12usize {
        shared[k * GROUP + unit] = own[k];
    }
    let mut sums = Shared::<[f32]>::new_slice(12usize);
    sync_cube();
    if unit < 12 {
        let mut sum = 0.0f32;
        for other in 0..GROUP {
            sum += shared[unit * GROUP + other];
        }
        sums[unit] = sum;
    }
    sync_cube();
    // Of [Rᵀ, s] with s = −Rᵀ t: ∂L/∂R = (∂L/∂Rᵀ)ᵀ − t (∂L/∂s)ᵀ, ∂L/∂t = −R ∂L/∂s
    if unit < 12 {
        let t = 12 * bone;
        let row = unit / 4;
        let column = unit % 4;
        let mut to = 0.0f32;
        if column == 3 {
            #[unroll]
            for b in 0..3usize {
                to -= sums[4 * b + 3] * transforms[t + 4 * row + b];
            }
        } else {
            to = sums[4 * column + row] - sums[4 * column + 3] * transforms[t + 4 * row + 3];
        }
        A::add(&mut to_transforms[t + unit], to);
    }
}
