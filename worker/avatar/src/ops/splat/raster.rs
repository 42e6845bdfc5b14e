//! Blending of a tile's splats, near to far, and its gradient. A row of pixels is a loop for which
//! the compiler uses wide instructions.

use super::flat::{Flat, FlatGradient};
use super::tiles::{AREA, SIDE};
use super::{LEAST, MOST};
use crate::ops::form::{Work, multiply_add};

/// Transmittance below which a tile is finished: an eighth of a step of 8-bit colour.
pub(super) const OPAQUE: f32 = 5e-4;
/// Splats between checks whether a tile is finished.
const CHECK_EVERY: usize = 16;

/// A tile of a picture: red, green, blue, opacity, and Σ T α z, metres.
pub(super) type Tile = [[f32; AREA]; 5];

/// eˣ for x in [−20, 0], to 2e-6 of it.
#[inline(always)]
fn exp<const FMA: bool>(x: f32) -> f32 {
    let y = x * std::f32::consts::LOG2_E;
    let whole = y.floor();
    let part = y - whole;
    // A polynomial of 2ˣ on [0, 1) with the least largest error.
    let mut sum = 1.877_58e-3;
    for c in [8.989_34e-3, 5.582_63e-2, 0.240_153_62, 0.693_153_1, 1.0] {
        sum = multiply_add::<FMA>(sum, part, c);
    }
    sum * f32::from_bits(((whole as i32 + 127) << 23) as u32)
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

/// Falloff and opacity of a splat along a row, whose first pixel is `left` of the picture's edge.
#[inline(always)]
fn opacities<const FMA: bool>(
    flat: &Flat,
    left: f32,
    dy: f32,
    falloff: &mut [f32; SIDE],
    alpha: &mut [f32; SIDE],
) {
    let [xx, xy, yy] = flat.conic;
    let (constant, linear) = (-0.5 * yy * dy * dy, xy * dy);
    for lane in 0..SIDE {
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
fn finished(count: usize, through: &[f32; AREA]) -> bool {
    count % CHECK_EVERY == CHECK_EVERY - 1
        && through.iter().fold(0f32, |most, t| most.max(*t)) < OPAQUE
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
        let [red, green, blue, opacity, depth] = self.out;
        let mut through = [1f32; AREA];
        let (mut falloff, mut alpha) = ([0f32; SIDE], [0f32; SIDE]);
        for (count, entry) in self.entries.iter().enumerate() {
            let flat = &self.flats[*entry as usize];
            for row in rows(flat, top) {
                let dy = top + row as f32 + 0.5 - flat.centre[1];
                opacities::<FMA>(flat, left, dy, &mut falloff, &mut alpha);
                let first = row * SIDE;
                for (lane, alpha) in alpha.iter().enumerate() {
                    let i = first + lane;
                    let weight = through[i] * alpha;
                    red[i] = multiply_add::<FMA>(weight, flat.colour[0], red[i]);
                    green[i] = multiply_add::<FMA>(weight, flat.colour[1], green[i]);
                    blue[i] = multiply_add::<FMA>(weight, flat.colour[2], blue[i]);
                    depth[i] = multiply_add::<FMA>(weight, flat.depth, depth[i]);
                    opacity[i] += weight;
                    through[i] -= weight;
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
        let [red, green, blue, opacity] = self.grad;
        let (mut through, mut behind) = ([1f32; AREA], self.dot);
        let (mut falloff, mut alpha) = ([0f32; SIDE], [0f32; SIDE]);
        for (count, (entry, out)) in self.entries.iter().zip(self.out).enumerate() {
            let flat = &self.flats[*entry as usize];
            let colour = flat.colour;
            let mut sums = [[0f32; SIDE]; 9];
            for row in rows(flat, top) {
                let dy = top + row as f32 + 0.5 - flat.centre[1];
                opacities::<FMA>(flat, left, dy, &mut falloff, &mut alpha);
                let first = row * SIDE;
                for lane in 0..SIDE {
                    let (i, a) = (first + lane, alpha[lane]);
                    let weight = through[i] * a;
                    let own = opacity[i]
                        + colour[0] * red[i]
                        + colour[1] * green[i]
                        + colour[2] * blue[i];
                    let rest = behind[i] - weight * own;
                    // Where opacity is cut off, it does not change.
                    let live = if a > 0.0 && a < MOST { 1.0 } else { 0.0 };
                    let to_alpha = live * (through[i] * own - rest / (1.0 - a));
                    behind[i] = rest;
                    through[i] -= weight;
                    let to_power = to_alpha * a;
                    let dx = left + lane as f32 - flat.centre[0];
                    let (px, py) = (to_power * dx, to_power * dy);
                    sums[0][lane] = multiply_add::<FMA>(weight, red[i], sums[0][lane]);
                    sums[1][lane] = multiply_add::<FMA>(weight, green[i], sums[1][lane]);
                    sums[2][lane] = multiply_add::<FMA>(weight, blue[i], sums[2][lane]);
                    sums[3][lane] = multiply_add::<FMA>(to_alpha, falloff[lane], sums[3][lane]);
                    sums[4][lane] += px;
                    sums[5][lane] += py;
                    sums[6][lane] = multiply_add::<FMA>(px, dx, sums[6][lane]);
                    sums[7][lane] = multiply_add::<FMA>(px, dy, sums[7][lane]);
                    sums[8][lane] = multiply_add::<FMA>(py, dy, sums[8][lane]);
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
