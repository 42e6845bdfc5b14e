//! Splatting on CPU threads: splats in parallel, then tiles in parallel. Gradients are summed in the
//! order of the tiles, whatever the number of threads.

use super::flat::{Flat, FlatGradient, Splat, SplatGradient, flatten, unflatten};
use super::light::LIGHTS;
use super::raster::{Blend, Tile, Unblend};
use super::tiles::{AREA, SIDE, Tiles};
use super::{ROW, Sight, SplatOps};
use crate::flex::tensor;
use crate::form::{Form, Work};
use burn::backend::{Flex, TensorMetadata, tensor::FloatTensor};
use rayon::prelude::*;

/// Splats per task.
const BLOCK: usize = 256;

/// Splats in host memory.
#[derive(Clone, Copy, Debug)]
pub struct Numbers<'a> {
    /// `[N, 12]` canonical to posed body.
    pub transforms: &'a [f32],
    /// `[N, 14]`: place, turn, scales, opacity and colour ([`super::Splats`]).
    pub rows: &'a [f32],
    /// `[3, 8]`.
    pub light: &'a [f32],
}

impl<'a> Numbers<'a> {
    fn count(&self) -> usize {
        self.rows.len() / ROW
    }

    pub(super) fn splat(&self, i: usize) -> Splat<'a> {
        let row = &self.rows.as_chunks::<ROW>().0[i];
        Splat {
            transform: &self.transforms.as_chunks().0[i],
            mean: std::array::from_fn(|a| row[a]),
            turn: std::array::from_fn(|a| row[3 + a]),
            scale: std::array::from_fn(|a| row[7 + a]),
            opacity: row[10],
            colour: std::array::from_fn(|a| row[11 + a]),
        }
    }

    pub(super) fn light(&self) -> [[f32; LIGHTS]; 3] {
        std::array::from_fn(|c| std::array::from_fn(|k| self.light[c * LIGHTS + k]))
    }

    pub(super) fn flats(&self, sight: &Sight) -> Vec<Flat> {
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
pub(super) struct Unflatten<'a> {
    pub splat: Splat<'a>,
    pub light: &'a [[f32; LIGHTS]; 3],
    pub sight: &'a Sight,
    pub to: &'a FlatGradient,
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

/// The picture of all `people`'s splats, each with the same camera in the frame of their body; `None`
/// if there is nobody. Whoever is nearer hides the others.
///
/// # Panics
/// If the cameras differ in size.
pub fn draw(people: &[(Numbers<'_>, &Sight)]) -> Option<Drawn> {
    let (_, sight) = people.first()?;
    let size = (sight.width, sight.height);
    assert!(people.iter().all(|(_, it)| (it.width, it.height) == size));
    let flats = people.iter().map(|(numbers, sight)| numbers.flats(sight));
    let flats: Vec<Flat> = flats.reduce(|mut all, more| {
        all.extend(more);
        all
    })?;
    Some(blend(&flats, sight).drawn(sight))
}

/// The tiles of a picture.
struct Blended {
    across: usize,
    tiles: Vec<Tile>,
}

impl Blended {
    /// The whole picture, over black.
    fn drawn(&self, sight: &Sight) -> Drawn {
        let area = sight.width * sight.height;
        let mut drawn = Drawn {
            rgb: vec![0.0; 3 * area],
            alpha: vec![0.0; area],
            depth: vec![0.0; area],
        };
        let width = sight.width.max(1);
        let rgb = drawn.rgb.par_chunks_mut(3 * width);
        let others = drawn.alpha.par_chunks_mut(width);
        let rows = rgb.zip(others.zip(drawn.depth.par_chunks_mut(width)));
        rows.enumerate().for_each(|(y, (rgb, (alpha, depth)))| {
            let pixels = rgb.as_chunks_mut::<3>().0.iter_mut();
            let pixels = pixels.zip(alpha.iter_mut().zip(depth));
            for (x, (rgb, (alpha, depth))) in pixels.enumerate() {
                let tile = &self.tiles[y / SIDE * self.across + x / SIDE];
                let i = y % SIDE * SIDE + x % SIDE;
                *rgb = [tile[0][i], tile[1][i], tile[2][i]];
                (*alpha, *depth) = (tile[3][i], tile[4][i]);
            }
        });
        drawn
    }

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
    rows: Vec<f32>,
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
        rows: vec![0.0; ROW * n],
        light: Vec::new(),
    };
    let mut to_light = [[0f64; LIGHTS]; 3];
    for (i, found) in found.iter().enumerate() {
        let Some(found) = found else { continue };
        all.transforms[12 * i..][..12].copy_from_slice(&found.transform);
        let row = &mut all.rows[ROW * i..][..ROW];
        row[..3].copy_from_slice(&found.mean);
        row[3..7].copy_from_slice(&found.turn);
        row[7..10].copy_from_slice(&found.scale);
        row[10] = found.opacity;
        row[11..].copy_from_slice(&found.colour);
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
        rows: FloatTensor<Self>,
        light: FloatTensor<Self>,
        sight: Sight,
    ) -> FloatTensor<Self> {
        let inputs = [transforms, rows, light].map(|tensor| tensor.to_contiguous());
        let drawn = blend(&numbers(&inputs).flats(&sight), &sight);
        let pixels = drawn.pixels(&sight, |tile, i| {
            std::array::from_fn::<_, 4, _>(|c| tile[c][i])
        });
        tensor(pixels, [sight.width * sight.height, 4])
    }

    fn splat_backward(
        transforms: FloatTensor<Self>,
        rows: FloatTensor<Self>,
        light: FloatTensor<Self>,
        picture: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        sight: Sight,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        let n = rows.shape()[0];
        let inputs = [transforms, rows, light].map(|tensor| tensor.to_contiguous());
        let [picture, grad] = [picture, grad].map(|tensor| tensor.to_contiguous());
        let to = backward(&numbers(&inputs), picture.storage(), grad.storage(), &sight);
        (
            tensor(to.transforms, [n, 12]),
            tensor(to.rows, [n, ROW]),
            tensor(to.light, [3, LIGHTS]),
        )
    }
}

/// The inputs of an operation, contiguous and in its order.
fn numbers(inputs: &[FloatTensor<Flex>; 3]) -> Numbers<'_> {
    let [transforms, rows, light] = inputs;
    Numbers {
        transforms: transforms.storage(),
        rows: rows.storage(),
        light: light.storage(),
    }
}
