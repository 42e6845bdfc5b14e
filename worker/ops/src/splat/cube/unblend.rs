//! The kernel that carries the gradient of a picture back to its splats.

use super::super::MOST;
use super::super::raster::OPAQUE;
use super::strip::{STRIP, THREADS, clearest, near, opacity_at, strip, unhidden};
use crate::cube::adding::{AddFloat, Bound};
use cubecl::prelude::*;

/// Sums per splat over its pixels: the gradients to red, green and blue; of the gradient g to the
/// exponent, g, and g times the offset x, y, x², x y and y².
pub(super) const SUMS: usize = 9;
/// Splats between exchanges in the group: their sums, and a flag per thread, fill most of the 16 KiB
/// that every Vulkan device shares.
const BATCH: usize = 6;

/// Adds the sums of each splat, `to_splats` `[N, 9]`, from the `picture` of [`blend_tiles`](super::blend::blend_tiles)
/// and the gradient `grad` to it, both `[H W, 4]`.
///
/// Splats are blended again, near to far: what is behind one is what was not yet in front. Each thread
/// sums over its strip, the group over its threads; only then the few groups that a splat lies in
/// share memory outside.
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
pub(super) fn unblend_tiles<A: AddFloat>(
    flats: &[f32],
    starts: &[u32],
    entries: &[u32],
    picture: &[f32],
    grad: &[f32],
    to_splats: &mut [Atomic<Bound<A>>],
    width: usize,
    height: usize,
) {
    let unit = UNIT_POS as usize;
    let strip = strip(width, height);
    let mut through = unhidden(&strip);
    let mut to = Array::<f32>::new(4 * STRIP);
    // What the splats from here on add to the product of picture and gradient.
    let mut behind = Array::<f32>::new(STRIP);
    #[unroll]
    for p in 0..STRIP {
        behind[p] = 0.0;
        #[unroll]
        for c in 0..4usize {
            to[4 * p + c] = 0.0;
            if p < strip.count {
                let at = 4 * (strip.first + p) + c;
                to[4 * p + c] = grad[at];
                behind[p] += grad[at] * picture[at];
            }
        }
    }
    let mut shared = Shared::<[f32]>::new_slice(BATCH * SUMS * THREADS);
    let mut open = Shared::<[u32]>::new_slice(THREADS + 1);
    let end = starts[strip.tile + 1] as usize;
    let mut first = starts[strip.tile] as usize;
    while first < end {
        for k in 0..BATCH {
            let mut own = Array::<f32>::new(SUMS);
            #[unroll]
            for s in 0..SUMS {
                own[s] = 0.0;
            }
            if first + k < end && clearest(&through) >= OPAQUE {
                let near = near(flats, entries[first + k] as usize, &strip);
                if near.reaches {
                    #[unroll]
                    for p in 0..STRIP {
                        let dx = near.dx + p as f32;
                        let alpha = opacity_at(&near, dx);
                        let weight = through[p] * alpha;
                        let value = to[4 * p + 3]
                            + near.red * to[4 * p]
                            + near.green * to[4 * p + 1]
                            + near.blue * to[4 * p + 2];
                        let rest = behind[p] - weight * value;
                        let mut to_power = 0.0f32;
                        // Where opacity is cut off, it does not change.
                        if alpha > 0.0 && alpha < MOST {
                            to_power = alpha * (through[p] * value - rest / (1.0 - alpha));
                        }
                        behind[p] = rest;
                        through[p] -= weight;
                        own[0usize] += weight * to[4 * p];
                        own[1usize] += weight * to[4 * p + 1];
                        own[2usize] += weight * to[4 * p + 2];
                        own[3usize] += to_power;
                        own[4usize] += to_power * dx;
                        own[5usize] += to_power * near.dy;
                        own[6usize] += to_power * dx * dx;
                        own[7usize] += to_power * dx * near.dy;
                        own[8usize] += to_power * near.dy * near.dy;
                    }
                }
            }
            #[unroll]
            for s in 0..SUMS {
                shared[(k * SUMS + s) * THREADS + unit] = own[s];
            }
        }
        let mut clear = 0u32;
        if clearest(&through) >= OPAQUE {
            clear = 1;
        }
        open[unit] = clear;
        sync_cube();
        if unit < BATCH * SUMS {
            let entry = first + unit / SUMS;
            if entry < end {
                let mut sum = 0.0f32;
                for i in 0..THREADS {
                    // Each thread begins elsewhere, since they would wait for the same memory bank.
                    sum += shared[unit * THREADS + (i + unit) % THREADS];
                }
                let splat = entries[entry] as usize;
                A::add(&mut to_splats[splat * SUMS + unit % SUMS], sum);
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
