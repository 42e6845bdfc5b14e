//! The backward pass of rasterization: from the gradient of a picture to its projected splats.

use super::super::MAX_ALPHA;
use super::super::rasterize::OPAQUE;
use super::tile_row::{
    SEGMENT, THREADS, alpha_at, initial_transmittance, load_splat, max_transmittance, segment,
};
use crate::cube::adding::{AddFloat, Bound};
use cubecl::prelude::*;

/// Sums per splat over its pixels: the gradients to red, green and blue; and with g the gradient to the exponent
/// and (x, y) the offset of a pixel, g, g x, g y, g x², g x y and g y².
pub(super) const SUMS: usize = 9;
/// Splats per exchange in the group: their sums and a flag per thread fill most of the 16 KiB of shared memory
/// that every Vulkan device has.
const BATCH: usize = 6;

/// Adds the sums of each splat, `to_splats` `[N, 9]`, from the `picture` of `rasterize_tiles`
/// and the gradient `grad` to it, both `[H W, 4]`.
///
/// The splats are blended again, near to far: what is behind a splat is the whole sum less what is in front of
/// it. Each thread sums over its segment and the group over its threads; only then do the few groups that a splat
/// lies in add to the same numbers in global memory.
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
pub(super) fn rasterize_tiles_backward<A: AddFloat>(
    projected: &[f32],
    starts: &[u32],
    entries: &[u32],
    picture: &[f32],
    grad: &[f32],
    to_splats: &mut [Atomic<Bound<A>>],
    width: usize,
    height: usize,
) {
    let unit = UNIT_POS as usize;
    let segment = segment(width, height);
    let mut transmittance = initial_transmittance(&segment);
    let mut to = Array::<f32>::new(4 * SEGMENT);
    // B = Σ T α v of the splats from here on; at first the product of picture and gradient
    let mut behind = Array::<f32>::new(SEGMENT);
    #[unroll]
    for p in 0..SEGMENT {
        behind[p] = 0.0;
        #[unroll]
        for c in 0..4usize {
            to[4 * p + c] = 0.0;
            if p < segment.count {
                let at = 4 * (segment.first + p) + c;
                to[4 * p + c] = grad[at];
                behind[p] += grad[at] * picture[at];
            }
        }
    }
    let mut shared = Shared::<[f32]>::new_slice(BATCH * SUMS * THREADS);
    let mut open = Shared::<[u32]>::new_slice(THREADS + 1);
    let end = starts[segment.tile + 1] as usize;
    let mut first = starts[segment.tile] as usize;
    while first < end {
        for k in 0..BATCH {
            let mut own = Array::<f32>::new(SUMS);
            #[unroll]
            for s in 0..SUMS {
                own[s] = 0.0;
            }
            if first + k < end && max_transmittance(&transmittance) >= OPAQUE {
                let splat = load_splat(projected, entries[first + k] as usize, &segment);
                if splat.reaches {
                    #[unroll]
                    for p in 0..SEGMENT {
                        let dx = splat.dx + p as f32;
                        let alpha = alpha_at(&splat, dx);
                        // v = ∂L/∂C · (c, 1): the gradient to the weight T α
                        let weight = transmittance[p] * alpha;
                        let value = to[4 * p + 3]
                            + splat.red * to[4 * p]
                            + splat.green * to[4 * p + 1]
                            + splat.blue * to[4 * p + 2];
                        let remaining = behind[p] - weight * value;
                        let mut to_power = 0.0f32;
                        // ∂L/∂p = α ∂L/∂α = α (T v − B / (1 − α)); 0 where α is clamped
                        if alpha > 0.0 && alpha < MAX_ALPHA {
                            to_power =
                                alpha * (transmittance[p] * value - remaining / (1.0 - alpha));
                        }
                        behind[p] = remaining;
                        transmittance[p] -= weight;
                        own[0usize] += weight * to[4 * p];
                        own[1usize] += weight * to[4 * p + 1];
                        own[2usize] += weight * to[4 * p + 2];
                        own[3usize] += to_power;
                        own[4usize] += to_power * dx;
                        own[5usize] += to_power * splat.dy;
                        own[6usize] += to_power * dx * dx;
                        own[7usize] += to_power * dx * splat.dy;
                        own[8usize] += to_power * splat.dy * splat.dy;
                    }
                }
            }
            #[unroll]
            for s in 0..SUMS {
                shared[(k * SUMS + s) * THREADS + unit] = own[s];
            }
        }
        let mut clear = 0u32;
        if max_transmittance(&transmittance) >= OPAQUE {
            clear = 1;
        }
        open[unit] = clear;
        sync_cube();
        if unit < BATCH * SUMS {
            let entry = first + unit / SUMS;
            if entry < end {
                let mut sum = 0.0f32;
                for i in 0..THREADS {
                    // Each thread begins at another number: otherwise all would wait for the same memory bank.
                    sum += shared[unit * THREADS + (i + unit) % THREADS];
                }
                let index = entries[entry] as usize;
                A::add(&mut to_splats[index * SUMS + unit % SUMS], sum);
            }
        }
        if unit == THREADS - 1 {
            let mut any = 0u32;
            for i in 0..THREADS {
                any += open[i];
            }
            open[THREADS] = any;
        }
        sync_cube();
        first += BATCH;
        if open[THREADS] == 0 {
            first = end;
        }
    }
}
