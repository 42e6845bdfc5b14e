//! Splatting on CPU threads: splats in parallel, then tiles in parallel. Gradients are summed in the
//! order of the tiles, whatever the number of threads.

use super::flat::{Flat, FlatGradient, Splat, SplatGradient, flatten, unflatten};
use super::light::LIGHTS;
use super::raster::{Blend, Tile, Unblend};
use super::tiles::{AREA, SIDE, Tiles};
use super::{Sight, SplatOps};
use crate::ops::flex::tensor;
use crate::ops::form::{Form, Work};
use burn::backend::{Flex, TensorMetadata, tensor::FloatTensor};
use rayon::prelude::*;

/// Splats per task.
const BLOCK: usize = 256;

/// Splats in host memory, in the layout of [`super::Splats`].
#[derive(Clone, Copy, Debug)]
pub struct Numbers<'a> {
    /// `[N, 12]`.
    pub transforms: &'a [f32],
    /// `[N, 3]`.
    pub means: &'a [f32],
    /// `[N, 4]`.
    pub turns: &'a [f32],
    /// `[N, 3]`.
    pub scales: &'a [f32],
    /// `[N]`.
    pub opacities: &'a [f32],
    /// `[N, 3]`.
    pub colours: &'a [f32],
    /// `[3, 8]`.
    pub light: &'a [f32],
}

impl<'a> Numbers<'a> {
    fn count(&self) -> usize {
        self.opacities.len()
    }

    fn splat(&self, i: usize) -> Splat<'a> {
        Splat {
            transform: &self.transforms.as_chunks().0[i],
            mean: &self.means.as_chunks().0[i],
            turn: &self.turns.as_chunks().0[i],
            scale: &self.scales.as_chunks().0[i],
            opacity: self.opacities[i],
            colour: &self.colours.as_chunks().0[i],
        }
    }

    fn light(&self) -> [[f32; LIGHTS]; 3] {
        std::array::from_fn(|c| std::array::from_fn(|k| self.light[c * LIGHTS + k]))
    }

    fn flats(&self, sight: &Sight) -> Vec<Flat> {
        let light = self.light();
        let splats = (0..self.count()).into_par_iter().with_min_len(BLOCK);
        splats
            .map(|i| {
                Form::best().run(Flatten {
                    splat: self.splat(i),
                    light: &light,
                    sight,
                })
            })
            .collect()
    }
}

/// [`flatten`] of a splat.
struct Flatten<'a> {
    splat: Splat<'a>,
    light: &'a [[f32; LIGHTS]; 3],
    sight: &'a Sight,
}

impl Work for Flatten<'_> {
    type Output = Flat;

    #[inline(always)]
    fn run<const FMA: bool>(self) -> Flat {
        flatten(&self.splat, self.light, self.sight)
    }
}

/// [`unflatten`] of a splat.
struct Unflatten<'a> {
    splat: Splat<'a>,
    light: &'a [[f32; LIGHTS]; 3],
    sight: &'a Sight,
    to: &'a FlatGradient,
}

impl Work for Unflatten<'_> {
    type Output = SplatGradient;

    #[inline(always)]
    fn run<const FMA: bool>(self) -> SplatGradient {
        unflatten(&self.splat, self.light, self.sight, self.to)
    }
}

/// A picture with depth.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// `[H, W, 3]`, over black.
    pub rgb: Vec<f32>,
    /// `[H, W]` opacity.
    pub alpha: Vec<f32>,
    /// `[H, W]` Σ T α z along the camera's axis, metres, not divided by opacity.
    pub depth: Vec<f32>,
}

/// The picture of splats, with their depth.
pub fn draw(numbers: &Numbers<'_>, sight: &Sight) -> Drawn {
    let drawn = blend(&numbers.flats(sight), sight);
    let one = |channel: usize| drawn.pixels(sight, |tile, i| [tile[channel][i]]);
    Drawn {
        rgb: drawn.pixels(sight, |tile, i| [tile[0][i], tile[1][i], tile[2][i]]),
        alpha: one(3),
        depth: one(4),
    }
}

/// The tiles of a picture.
struct Blended {
    across: usize,
    tiles: Vec<Tile>,
}

impl Blended {
    /// `[H, W, C]`: C numbers of each pixel.
    fn pixels<const C: usize>(
        &self,
        sight: &Sight,
        of: impl Fn(&Tile, usize) -> [f32; C] + Sync,
    ) -> Vec<f32> {
        let mut pixels = vec![0f32; C * sight.width * sight.height];
        let rows = pixels.par_chunks_mut((C * sight.width).max(1)).enumerate();
        rows.for_each(|(y, row)| {
            for (x, pixel) in row.as_chunks_mut::<C>().0.iter_mut().enumerate() {
                let tile = &self.tiles[y / SIDE * self.across + x / SIDE];
                *pixel = of(tile, y % SIDE * SIDE + x % SIDE);
            }
        });
        pixels
    }
}

fn blend(flats: &[Flat], sight: &Sight) -> Blended {
    let tiles = Tiles::new(flats, sight.width, sight.height);
    let mut blended = vec![[[0f32; AREA]; 5]; tiles.count()];
    blended.par_iter_mut().enumerate().for_each(|(tile, out)| {
        Form::best().run(Blend {
            flats,
            entries: tiles.of(tile),
            corner: tiles.corner(tile),
            out,
        });
    });
    Blended {
        across: tiles.across,
        tiles: blended,
    }
}

/// Gradients to all inputs, of their shapes.
struct Gradients {
    transforms: Vec<f32>,
    means: Vec<f32>,
    turns: Vec<f32>,
    scales: Vec<f32>,
    opacities: Vec<f32>,
    colours: Vec<f32>,
    light: Vec<f32>,
}

/// From the `picture` `[H W, 4]` and the gradient to it.
fn backward(numbers: &Numbers<'_>, picture: &[f32], grad: &[f32], sight: &Sight) -> Gradients {
    let flats = numbers.flats(sight);
    let to_flats = unblend(&flats, picture, grad, sight);
    let light = numbers.light();
    let found: Vec<_> = (0..numbers.count())
        .into_par_iter()
        .with_min_len(BLOCK)
        .map(|i| {
            let seen = flats[i].opacity > 0.0;
            let splat = numbers.splat(i);
            seen.then(|| {
                Form::best().run(Unflatten {
                    splat,
                    light: &light,
                    sight,
                    to: &to_flats[i],
                })
            })
        })
        .collect();
    let n = numbers.count();
    let mut all = Gradients {
        transforms: vec![0.0; 12 * n],
        means: vec![0.0; 3 * n],
        turns: vec![0.0; 4 * n],
        scales: vec![0.0; 3 * n],
        opacities: vec![0.0; n],
        colours: vec![0.0; 3 * n],
        light: Vec::new(),
    };
    let mut to_light = [[0f64; LIGHTS]; 3];
    for (i, found) in found.iter().enumerate() {
        let Some(found) = found else { continue };
        all.transforms[12 * i..][..12].copy_from_slice(&found.transform);
        all.means[3 * i..][..3].copy_from_slice(&found.mean);
        all.turns[4 * i..][..4].copy_from_slice(&found.turn);
        all.scales[3 * i..][..3].copy_from_slice(&found.scale);
        all.opacities[i] = found.opacity;
        all.colours[3 * i..][..3].copy_from_slice(&found.colour);
        let sums = to_light.as_flattened_mut().iter_mut();
        for (sum, term) in sums.zip(found.light.as_flattened()) {
            *sum += f64::from(*term);
        }
    }
    all.light = to_light.as_flattened().iter().map(|v| *v as f32).collect();
    all
}

/// Gradients to the splats in the picture.
fn unblend(flats: &[Flat], picture: &[f32], grad: &[f32], sight: &Sight) -> Vec<FlatGradient> {
    let tiles = Tiles::new(flats, sight.width, sight.height);
    let (picture, grad) = (picture.as_chunks::<4>().0, grad.as_chunks::<4>().0);
    let mut by_entry = vec![FlatGradient::default(); tiles.entries.len()];
    let mut parts = Vec::with_capacity(tiles.count());
    let mut rest = by_entry.as_mut_slice();
    for tile in 0..tiles.count() {
        let (part, others) = rest.split_at_mut(tiles.of(tile).len());
        parts.push(part);
        rest = others;
    }
    parts.into_par_iter().enumerate().for_each(|(tile, out)| {
        let corner = tiles.corner(tile);
        let (mut to, mut dot) = ([[0f32; AREA]; 4], [0f32; AREA]);
        for i in 0..AREA {
            let (x, y) = (corner[0] + i % SIDE, corner[1] + i / SIDE);
            if x < sight.width && y < sight.height {
                let pixel = y * sight.width + x;
                for c in 0..4 {
                    to[c][i] = grad[pixel][c];
                    dot[i] += grad[pixel][c] * picture[pixel][c];
                }
            }
        }
        Form::best().run(Unblend {
            flats,
            entries: tiles.of(tile),
            corner,
            grad: &to,
            dot,
            out,
        });
    });
    let mut to_flats = vec![FlatGradient::default(); flats.len()];
    for (entry, gradient) in tiles.entries.iter().zip(&by_entry) {
        to_flats[*entry as usize].add(gradient);
    }
    to_flats
}

impl SplatOps for Flex {
    fn splat(
        transforms: FloatTensor<Self>,
        means: FloatTensor<Self>,
        turns: FloatTensor<Self>,
        scales: FloatTensor<Self>,
        opacities: FloatTensor<Self>,
        colours: FloatTensor<Self>,
        light: FloatTensor<Self>,
        sight: Sight,
    ) -> FloatTensor<Self> {
        let inputs = [transforms, means, turns, scales, opacities, colours, light]
            .map(|tensor| tensor.to_contiguous());
        let drawn = blend(&numbers(&inputs).flats(&sight), &sight);
        let pixels = drawn.pixels(&sight, |tile, i| {
            std::array::from_fn::<_, 4, _>(|c| tile[c][i])
        });
        tensor(pixels, [sight.width * sight.height, 4])
    }

    fn splat_backward(
        transforms: FloatTensor<Self>,
        means: FloatTensor<Self>,
        turns: FloatTensor<Self>,
        scales: FloatTensor<Self>,
        opacities: FloatTensor<Self>,
        colours: FloatTensor<Self>,
        light: FloatTensor<Self>,
        picture: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        sight: Sight,
    ) -> (
        FloatTensor<Self>,
        FloatTensor<Self>,
        FloatTensor<Self>,
        FloatTensor<Self>,
        FloatTensor<Self>,
        FloatTensor<Self>,
        FloatTensor<Self>,
    ) {
        let n = means.shape()[0];
        let inputs = [transforms, means, turns, scales, opacities, colours, light]
            .map(|tensor| tensor.to_contiguous());
        let [picture, grad] = [picture, grad].map(|tensor| tensor.to_contiguous());
        let to = backward(&numbers(&inputs), picture.storage(), grad.storage(), &sight);
        (
            tensor(to.transforms, [n, 12]),
            tensor(to.means, [n, 3]),
            tensor(to.turns, [n, 4]),
            tensor(to.scales, [n, 3]),
            tensor(to.opacities, [n]),
            tensor(to.colours, [n, 3]),
            tensor(to.light, [3, LIGHTS]),
        )
    }
}

/// The inputs of an operation, contiguous and in its order.
fn numbers(inputs: &[FloatTensor<Flex>; 7]) -> Numbers<'_> {
    let [transforms, means, turns, scales, opacities, colours, light] = inputs;
    Numbers {
        transforms: transforms.storage(),
        means: means.storage(),
        turns: turns.storage(),
        scales: scales.storage(),
        opacities: opacities.storage(),
        colours: colours.storage(),
        light: light.storage(),
    }
}
