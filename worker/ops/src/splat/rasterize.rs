//! Rasterization of a tile: alpha blending of its splats, near to far (3D Gaussian splatting, arXiv
//! 2308.04079, eq. 2 and 3), and its gradient. Groups of pixels in a row are loops that the compiler
//! vectorizes.

use super::projected::Projected;
use super::projected_backward::ProjectedGradient;
use super::tiles::{AREA, SIDE};
use super::{MAX_ALPHA, MIN_ALPHA};
use crate::form::{Work, multiply_add};

/// Transmittance below which nothing behind can be seen: an eighth of a step of 8-bit colour.
pub(super) const OPAQUE: f32 = 5e-4;
/// Splats between checks of whether a tile is finished.
const CHECK_EVERY: usize = 16;
/// Pixels that are blended together: those of one vector instruction. Most splats cover only a part of a row.
const LANES: usize = 8;
/// Groups of [`LANES`] pixels in a tile, row by row.
const GROUPS: usize = AREA / LANES;

/// The pixels of a tile: red, green, blue, opacity, and Σ T α z, metres.
pub(super) type Tile = [[f32; AREA]; 5];

/// A number whose sum with another of at most 2²² has the nearest whole number in its last bits.
const ROUNDING: f32 = 12_582_912.0;

/// eˣ for x in [−20, 0], with a relative error of 3e-7.
#[inline(always)]
fn exp<const FMA: bool>(x: f32) -> f32 {
    // eˣ = 2ʸ = 2ⁿ 2ᶠ with y = n + f, n whole and f in [−1/2, 1/2]
    let y = x * std::f32::consts::LOG2_E;
    // A sum and a shift take one vector instruction each; a checked cast takes several.
    let shifted = y + ROUNDING;
    let part = y - (shifted - ROUNDING);
    // The minimax polynomial of 2ᶠ.
    let mut sum = 1.327_647_2e-3;
    for c in [9.675_542e-3, 5.550_713e-2, 0.240_221_2, 0.693_146_94, 1.0] {
        sum = multiply_add::<FMA>(sum, part, c);
    }
    sum * f32::from_bits(shifted.to_bits().wrapping_add(127) << 23)
}

/// Rows of the tile that a splat covers, if the first row begins at `top`.
#[inline(always)]
fn rows(splat: &Projected, top: f32) -> std::ops::Range<usize> {
    let first = (splat.centre[1] - splat.extent[1] - top - 0.5)
        .ceil()
        .max(0.0);
    let last = (splat.centre[1] + splat.extent[1] - top - 0.5).floor();
    // Empty, also for a NaN.
    if last >= first {
        first as usize..(last as usize + 1).min(SIDE)
    } else {
        0..0
    }
}

/// Groups of [`LANES`] pixels in a row of the tile that a splat covers, if the row's first pixel centre is at
/// `left`.
#[inline(always)]
fn groups(splat: &Projected, left: f32) -> std::ops::Range<usize> {
    let first = (splat.centre[0] - splat.extent[0] - left).ceil().max(0.0);
    let last = (splat.centre[0] + splat.extent[0] - left).floor();
    // Empty, also for a NaN.
    if last >= first {
        first as usize / LANES..(last as usize / LANES + 1).min(SIDE / LANES)
    } else {
        0..0
    }
}

/// Falloff G and opacity α of a splat at [`LANES`] pixels of a row. `left` is the x of the first pixel's centre,
/// `dy` the offset of the row from the splat's centre.
#[inline(always)]
fn opacities<const FMA: bool>(
    splat: &Projected,
    left: f32,
    dy: f32,
    falloff: &mut [f32; LANES],
    alpha: &mut [f32; LANES],
) {
    let [xx, xy, yy] = splat.conic;
    // G = exp(−(xx dx² + 2 xy dx dy + yy dy²) / 2) (eq. 4), α = min(o G, MAX_ALPHA)
    let (constant, linear) = (-0.5 * yy * dy * dy, xy * dy);
    for lane in 0..LANES {
        let dx = left + lane as f32 - splat.centre[0];
        let power = constant - dx * multiply_add::<FMA>(0.5 * xx, dx, linear);
        // Rounding can make the power of a large splat positive.
        let g = exp::<FMA>(power.clamp(-20.0, 0.0));
        let a = (splat.opacity * g).min(MAX_ALPHA);
        falloff[lane] = g;
        alpha[lane] = if a >= MIN_ALPHA { a } else { 0.0 };
    }
}

/// Whether nothing behind can be seen any more; checked only after every [`CHECK_EVERY`]-th splat.
#[inline(always)]
fn finished(count: usize, transmittance: &[[f32; LANES]; GROUPS]) -> bool {
    count % CHECK_EVERY == CHECK_EVERY - 1
        && transmittance
            .as_flattened()
            .iter()
            .fold(0f32, |most, t| most.max(*t))
            < OPAQUE
}

/// Blends the splats of a tile into `out`, which starts as zeros.
pub(super) struct RasterizeTile<'a> {
    pub projected: &'a [Projected],
    /// Indices of the tile's splats, near to far.
    pub entries: &'a [u32],
    /// Column and row of the tile's first pixel.
    pub corner: [usize; 2],
    pub out: &'a mut Tile,
}

impl Work for RasterizeTile<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        let (left, top) = (self.corner[0] as f32 + 0.5, self.corner[1] as f32);
        let channels = self.out.each_mut();
        let [red, green, blue, opacity, depth] =
            channels.map(|channel| channel.as_chunks_mut::<LANES>().0);
        let mut transmittance = [[1f32; LANES]; GROUPS];
        let (mut falloff, mut alpha) = ([0f32; LANES], [0f32; LANES]);
        for (count, entry) in self.entries.iter().enumerate() {
            let splat = &self.projected[*entry as usize];
            let across = groups(splat, left);
            for row in rows(splat, top) {
                let dy = top + row as f32 + 0.5 - splat.centre[1];
                for group in across.clone() {
                    let start = left + (group * LANES) as f32;
                    opacities::<FMA>(splat, start, dy, &mut falloff, &mut alpha);
                    let i = row * (SIDE / LANES) + group;
                    let (red, green, blue) = (&mut red[i], &mut green[i], &mut blue[i]);
                    let (opacity, depth) = (&mut opacity[i], &mut depth[i]);
                    let transmittance = &mut transmittance[i];
                    for lane in 0..LANES {
                        // C += T α c, then T ← T (1 − α) (eq. 2 and 3)
                        let weight = transmittance[lane] * alpha[lane];
                        red[lane] = multiply_add::<FMA>(weight, splat.colour[0], red[lane]);
                        green[lane] = multiply_add::<FMA>(weight, splat.colour[1], green[lane]);
                        blue[lane] = multiply_add::<FMA>(weight, splat.colour[2], blue[lane]);
                        depth[lane] = multiply_add::<FMA>(weight, splat.depth, depth[lane]);
                        opacity[lane] += weight;
                        transmittance[lane] -= weight;
                    }
                }
            }
            if finished(count, &transmittance) {
                break;
            }
        }
    }
}

/// Gradients to the splats of a tile, one per entry, from the gradient `grad` to red, green, blue and
/// opacity of its pixels and `dot`, the product of that gradient and the picture. The splats are blended
/// again, near to far: what is behind a splat is the whole sum less what is in front of it. So no
/// transmittance has to be kept from the forward pass.
pub(super) struct RasterizeTileBackward<'a> {
    pub projected: &'a [Projected],
    pub entries: &'a [u32],
    pub corner: [usize; 2],
    pub grad: &'a [[f32; AREA]; 4],
    pub dot: [f32; AREA],
    pub out: &'a mut [ProjectedGradient],
}

impl Work for RasterizeTileBackward<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        let (left, top) = (self.corner[0] as f32 + 0.5, self.corner[1] as f32);
        let channels = self.grad.each_ref();
        let [red, green, blue, opacity] = channels.map(|channel| channel.as_chunks::<LANES>().0);
        let mut transmittance = [[1f32; LANES]; GROUPS];
        let mut dot = self.dot;
        let behind = dot.as_chunks_mut::<LANES>().0;
        let (mut falloff, mut alpha) = ([0f32; LANES], [0f32; LANES]);
        for (count, (entry, out)) in self.entries.iter().zip(self.out).enumerate() {
            let splat = &self.projected[*entry as usize];
            let colour = splat.colour;
            let across = groups(splat, left);
            let mut sums = [[0f32; LANES]; 9];
            for row in rows(splat, top) {
                let dy = top + row as f32 + 0.5 - splat.centre[1];
                for group in across.clone() {
                    let start = left + (group * LANES) as f32;
                    opacities::<FMA>(splat, start, dy, &mut falloff, &mut alpha);
                    let i = row * (SIDE / LANES) + group;
                    let (red, green, blue, opacity) = (&red[i], &green[i], &blue[i], &opacity[i]);
                    let (transmittance, behind) = (&mut transmittance[i], &mut behind[i]);
                    for lane in 0..LANES {
                        let a = alpha[lane];
                        let weight = transmittance[lane] * a;
                        // v = ∂L/∂C · (c, 1): the gradient to the weight T α
                        let value = opacity[lane]
                            + colour[0] * red[lane]
                            + colour[1] * green[lane]
                            + colour[2] * blue[lane];
                        // B = Σ T α v of the splats behind this one
                        let remaining = behind[lane] - weight * value;
                        // ∂L/∂α = T v − B / (1 − α); 0 where α is clamped
                        let live = if a > 0.0 && a < MAX_ALPHA { 1.0 } else { 0.0 };
                        let to_alpha = live * (transmittance[lane] * value - remaining / (1.0 - a));
                        behind[lane] = remaining;
                        transmittance[lane] -= weight;
                        // Of α = o exp(p): ∂L/∂p = ∂L/∂α α and ∂L/∂o = ∂L/∂α G
                        let to_power = to_alpha * a;
                        let dx = start + lane as f32 - splat.centre[0];
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
            // Σ over the tile's pixels of ∂L/∂c, ∂L/∂o, and of ∂L/∂p dx, dy, dx², dx dy, dy²
            let [r, g, b, o, x, y, x2, xy2, y2] = sums.map(|lanes| lanes.iter().sum::<f32>());
            let [xx, xy, yy] = splat.conic;
            *out = ProjectedGradient {
                // p = −(xx dx² + 2 xy dx dy + yy dy²) / 2 with d = pixel − centre, so ∂p/∂centre = conic d
                centre: [xx * x + xy * y, xy * x + yy * y],
                conic: [-0.5 * x2, -xy2, -0.5 * y2],
                opacity: o,
                colour: [r, g, b],
            };
            if finished(count, &transmittance) {
                break;
            }
        }
    }
}
