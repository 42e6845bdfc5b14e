//! Blending of a tile's splats, near to far, and its gradient. A row of pixels is a loop for which
//! the compiler uses wide instructions.

use super::flat::{Flat, FlatGradient};
use super::tiles::{AREA, SIDE};
use super::{LEAST, MOST};
use crate::form::{Work, multiply_add};

/// Transmittance below which a tile is finished: an eighth of a step of 8-bit colour.
pub(super) const OPAQUE: f32 = 5e-4;
/// Splats between checks whether a tile is finished.
const CHECK_EVERY: usize = 16;
/// Pixels that are blended together: those of a wide instruction. Most splats reach only a part of a row.
const LANES: usize = 8;
/// Groups of [`LANES`] pixels in a tile, row by row.
const GROUPS: usize = AREA / LANES;

/// A tile of a picture: red, green, blue, opacity, and Σ T α z, metres.
pub(super) type Tile = [[f32; AREA]; 5];

/// A number whose sum with another of at most 2²² has the nearest whole number in its last bits.
const ROUNDING: f32 = 12_582_912.0;

/// eˣ for x in [−20, 0], to 3e-7 of it.
#[inline(always)]
fn exp<const FMA: bool>(x: f32) -> f32 {
    let y = x * std::f32::consts::LOG2_E;
    // A sum and a shift take one wide instruction each; a checked cast takes several.
    let shifted = y + ROUNDING;
    let part = y - (shifted - ROUNDING);
    // A polynomial of 2ˣ on [−1/2, 1/2] with the least largest error.
    let mut sum = 1.327_647_2e-3;
    for c in [9.675_542e-3, 5.550_713e-2, 0.240_221_2, 0.693_146_94, 1.0] {
        sum = multiply_add::<FMA>(sum, part, c);
    }
    sum * f32::from_bits(shifted.to_bits().wrapping_add(127) << 23)
}

/// Rows of the tile that a splat reaches.
#[inline(always)]
fn rows(flat: &Flat, top: f32) -> std::ops::Range<usize> {
    let first = (flat.centre[1] - flat.reach[1] - top - 0.5).ceil().max(0.0);
    let last = (flat.centre[1] + flat.reach[1] - top - 0.5).floor();
    // Empty, also for a NaN.
    if last >= first {
        first as usize..(last as usize + 1).min(SIDE)
    } else {
        0..0
    }
}

/// Groups of [`LANES`] pixels in a row of the tile that a splat reaches, if the row's first pixel centre is at
/// `left`.
#[inline(always)]
fn groups(flat: &Flat, left: f32) -> std::ops::Range<usize> {
    let first = (flat.centre[0] - flat.reach[0] - left).ceil().max(0.0);
    let last = (flat.centre[0] + flat.reach[0] - left).floor();
    // Empty, also for a NaN.
    if last >= first {
        first as usize / LANES..(last as usize / LANES + 1).min(SIDE / LANES)
    } else {
        0..0
    }
}

/// Falloff and opacity of a splat at [`LANES`] pixels of a row, of which the first has its centre at `left`.
#[inline(always)]
fn opacities<const FMA: bool>(
    flat: &Flat,
    left: f32,
    dy: f32,
    falloff: &mut [f32; LANES],
    alpha: &mut [f32; LANES],
) {
    let [xx, xy, yy] = flat.conic;
    let (constant, linear) = (-0.5 * yy * dy * dy, xy * dy);
    for lane in 0..LANES {
        let dx = left + lane as f32 - flat.centre[0];
        let power = constant - dx * multiply_add::<FMA>(0.5 * xx, dx, linear);
        let g = exp::<FMA>(power.clamp(-20.0, 0.0));
        let a = (flat.opacity * g).min(MOST);
        falloff[lane] = g;
        alpha[lane] = if a >= LEAST { a } else { 0.0 };
    }
}

/// Whether nothing behind can be seen any more, looked at after every [`CHECK_EVERY`]-th splat.
#[inline(always)]
fn finished(count: usize, through: &[[f32; LANES]; GROUPS]) -> bool {
    count % CHECK_EVERY == CHECK_EVERY - 1
        && through
            .as_flattened()
            .iter()
            .fold(0f32, |most, t| most.max(*t))
            < OPAQUE
}

/// Blends the splats of a tile.
pub(super) struct Blend<'a> {
    pub flats: &'a [Flat],
    pub entries: &'a [u32],
    pub corner: [usize; 2],
    pub out: &'a mut Tile,
}

impl Work for Blend<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        let (left, top) = (self.corner[0] as f32 + 0.5, self.corner[1] as f32);
        let channels = self.out.each_mut();
        let [red, green, blue, opacity, depth] = channels.map(|it| it.as_chunks_mut::<LANES>().0);
        let mut through = [[1f32; LANES]; GROUPS];
        let (mut falloff, mut alpha) = ([0f32; LANES], [0f32; LANES]);
        for (count, entry) in self.entries.iter().enumerate() {
            let flat = &self.flats[*entry as usize];
            let across = groups(flat, left);
            for row in rows(flat, top) {
                let dy = top + row as f32 + 0.5 - flat.centre[1];
                for group in across.clone() {
                    let start = left + (group * LANES) as f32;
                    opacities::<FMA>(flat, start, dy, &mut falloff, &mut alpha);
                    let i = row * (SIDE / LANES) + group;
                    let (red, green, blue) = (&mut red[i], &mut green[i], &mut blue[i]);
                    let (opacity, depth) = (&mut opacity[i], &mut depth[i]);
                    let through = &mut through[i];
                    for lane in 0..LANES {
                        let weight = through[lane] * alpha[lane];
                        red[lane] = multiply_add::<FMA>(weight, flat.colour[0], red[lane]);
                        green[lane] = multiply_add::<FMA>(weight, flat.colour[1], green[lane]);
                        blue[lane] = multiply_add::<FMA>(weight, flat.colour[2], blue[lane]);
                        depth[lane] = multiply_add::<FMA>(weight, flat.depth, depth[lane]);
                        opacity[lane] += weight;
                        through[lane] -= weight;
                    }
                }
            }
            if finished(count, &through) {
                break;
            }
        }
    }
}

/// Gradients to the splats of a tile, one per entry, from the gradient `grad` to red, green, blue and
/// opacity of its pixels and `dot`, the product of the gradient and the picture. They are blended
/// again, near to far: what is behind a splat is what was not yet in front.
pub(super) struct Unblend<'a> {
    pub flats: &'a [Flat],
    pub entries: &'a [u32],
    pub corner: [usize; 2],
    pub grad: &'a [[f32; AREA]; 4],
    pub dot: [f32; AREA],
    pub out: &'a mut [FlatGradient],
}

impl Work for Unblend<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        let (left, top) = (self.corner[0] as f32 + 0.5, self.corner[1] as f32);
        let channels = self.grad.each_ref();
        let [red, green, blue, opacity] = channels.map(|it| it.as_chunks::<LANES>().0);
        let mut through = [[1f32; LANES]; GROUPS];
        let mut dot = self.dot;
        let behind = dot.as_chunks_mut::<LANES>().0;
        let (mut falloff, mut alpha) = ([0f32; LANES], [0f32; LANES]);
        for (count, (entry, out)) in self.entries.iter().zip(self.out).enumerate() {
            let flat = &self.flats[*entry as usize];
            let colour = flat.colour;
            let across = groups(flat, left);
            let mut sums = [[0f32; LANES]; 9];
            for row in rows(flat, top) {
                let dy = top + row as f32 + 0.5 - flat.centre[1];
                for group in across.clone() {
                    let start = left + (group * LANES) as f32;
                    opacities::<FMA>(flat, start, dy, &mut falloff, &mut alpha);
                    let i = row * (SIDE / LANES) + group;
                    let (red, green, blue, opacity) = (&red[i], &green[i], &blue[i], &opacity[i]);
                    let (through, behind) = (&mut through[i], &mut behind[i]);
                    for lane in 0..LANES {
                        let a = alpha[lane];
                        let weight = through[lane] * a;
                        let own = opacity[lane]
                            + colour[0] * red[lane]
                            + colour[1] * green[lane]
                            + colour[2] * blue[lane];
                        let rest = behind[lane] - weight * own;
                        // Where opacity is cut off, it does not change.
                        let live = if a > 0.0 && a < MOST { 1.0 } else { 0.0 };
                        let to_alpha = live * (through[lane] * own - rest / (1.0 - a));
                        behind[lane] = rest;
                        through[lane] -= weight;
                        let to_power = to_alpha * a;
                        let dx = start + lane as f32 - flat.centre[0];
                        let (px, py) = (to_power * dx, to_power * dy);
                        sums[0][lane] = multiply_add::<FMA>(weight, red[lane], sums[0][lane]);
                        sums[1][lane] = multiply_add::<FMA>(weight, green[lane], sums[1][lane]);
                        sums[2][lane] = multiply_add::<FMA>(weight, blue[lane], sums[2][lane]);
                        sums[3][lane] = multiply_add::<FMA>(to_alpha, falloff[lane], sums[3][lane]);
                        sums[4][lane] += px;
                        sums[5][lane] += py;
                        sums[6][lane] = multiply_add::<FMA>(px, dx, sums[6][lane]);
                        sums[7][lane] = multiply_add::<FMA>(px, dy, sums[7][lane]);
                        sums[8][lane] = multiply_add::<FMA>(py, dy, sums[8][lane]);
                    }
                }
            }
            let [r, g, b, o, x, y, x2, xy2, y2] = sums.map(|lanes| lanes.iter().sum::<f32>());
            let [xx, xy, yy] = flat.conic;
            *out = FlatGradient {
                // The exponent is −(xx dx² + 2 xy dx dy + yy dy²) / 2.
                centre: [xx * x + xy * y, xy * x + yy * y],
                conic: [-0.5 * x2, -xy2, -0.5 * y2],
                opacity: o,
                colour: [r, g, b],
            };
            if finished(count, &through) {
                break;
            }
        }
    }
}
