//! Splatting on CPU threads: projection in parallel over splats, rasterization in parallel over tiles.
//! Gradients are summed in the order of the tiles, whatever the number of threads.

use super::light::LIGHTS;
use super::projected::{Projected, Splat, project};
use super::projected_backward::{ProjectedGradient, SplatGradient, project_backward};
use super::rasterize::{RasterizeTile, RasterizeTileBackward, Tile};
use super::tiles::{AREA, SIDE, Tiles};
use super::{ROW, SplatOps, SplatRow, View};
use crate::flex::tensor;
use crate::form::{Form, Work};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Flex, TensorMetadata};
use rayon::prelude::*;

/// Splats per task.
const BLOCK: usize = 256;

/// Splats as slices of host memory.
#[derive(Clone, Copy, Debug)]
pub struct SplatSlices<'a> {
    /// `[N, 12]` canonical to posed body.
    pub transforms: &'a [f32],
    /// `[N, 14]`: mean, rotation, scales, opacity and colour ([`super::Splats`]).
    pub rows: &'a [f32],
    /// `[3, 8]` ([`super::light`]).
    pub light: &'a [f32],
}

impl<'a> SplatSlices<'a> {
    fn count(&self) -> usize {
        self.rows.len() / ROW
    }

    pub(super) fn splat(&self, i: usize) -> Splat<'a> {
        let row = SplatRow::from(self.rows.as_chunks::<ROW>().0[i]);
        Splat {
            transform: &self.transforms.as_chunks().0[i],
            mean: row.mean,
            rotation: row.rotation,
            scale: row.scales,
            opacity: row.opacity,
            colour: row.colour,
        }
    }

    pub(super) fn light(&self) -> [[f32; LIGHTS]; 3] {
        std::array::from_fn(|c| std::array::from_fn(|k| self.light[c * LIGHTS + k]))
    }

    pub(super) fn projected(&self, view: &View) -> Vec<Projected> {
        let light = self.light();
        let splats = (0..self.count()).into_par_iter().with_min_len(BLOCK);
        splats
            .map(|i| {
                Form::best().run(Project {
                    splat: self.splat(i),
                    light: &light,
                    view,
                })
            })
            .collect()
    }
}

/// [`project`] of a splat.
struct Project<'a> {
    splat: Splat<'a>,
    light: &'a [[f32; LIGHTS]; 3],
    view: &'a View,
}

impl Work for Project<'_> {
    type Output = Projected;

    #[inline(always)]
    fn run<const FMA: bool>(self) -> Projected {
        project(&self.splat, self.light, self.view)
    }
}

/// [`project_backward`] of a splat.
pub(super) struct ProjectBackward<'a> {
    pub splat: Splat<'a>,
    pub light: &'a [[f32; LIGHTS]; 3],
    pub view: &'a View,
    pub to: &'a ProjectedGradient,
}

impl Work for ProjectBackward<'_> {
    type Output = SplatGradient;

    #[inline(always)]
    fn run<const FMA: bool>(self) -> SplatGradient {
        project_backward(&self.splat, self.light, self.view, self.to)
    }
}

/// A picture with depth.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// `[H, W, 3]`, over black.
    pub rgb: Vec<f32>,
    /// `[H, W]` opacity.
    pub alpha: Vec<f32>,
    /// `[H, W]` Σ T α z along the camera's axis, metres, not divided by opacity.
    pub depth: Vec<f32>,
}

/// One picture of the splats of all `people`, each with the same camera in the frame of their body; `None`
/// without people. Nearer splats hide those behind, also of other people.
///
/// # Panics
/// If the cameras differ in size.
pub fn render(people: &[(SplatSlices<'_>, &View)]) -> Option<Rendered> {
    let (_, view) = people.first()?;
    let size = (view.width, view.height);
    let sizes = people.iter().map(|(_, view)| (view.width, view.height));
    assert!(sizes.into_iter().all(|other| other == size));
    let projected = people.iter().map(|(slices, view)| slices.projected(view));
    let projected: Vec<Projected> = projected.reduce(|mut all, more| {
        all.extend(more);
        all
    })?;
    Some(rasterize(&projected, view).rendered(view))
}

/// A picture as tiles.
struct Rasterized {
    across: usize,
    tiles: Vec<Tile>,
}

impl Rasterized {
    /// The whole picture, over black.
    fn rendered(&self, view: &View) -> Rendered {
        let area = view.width * view.height;
        let mut rendered = Rendered {
            rgb: vec![0.0; 3 * area],
            alpha: vec![0.0; area],
            depth: vec![0.0; area],
        };
        let width = view.width.max(1);
        let rgb = rendered.rgb.par_chunks_mut(3 * width);
        let others = rendered.alpha.par_chunks_mut(width);
        let rows = rgb.zip(others.zip(rendered.depth.par_chunks_mut(width)));
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
        rendered
    }

    /// `[H, W, C]`: the C numbers that `of` takes from each pixel of a tile.
    fn pixels<const C: usize>(
        &self,
        view: &View,
        of: impl Fn(&Tile, usize) -> [f32; C] + Sync,
    ) -> Vec<f32> {
        let mut pixels = vec![0f32; C * view.width * view.height];
        let rows = pixels.par_chunks_mut((C * view.width).max(1)).enumerate();
        rows.for_each(|(y, row)| {
            for (x, pixel) in row.as_chunks_mut::<C>().0.iter_mut().enumerate() {
                let tile = &self.tiles[y / SIDE * self.across + x / SIDE];
                *pixel = of(tile, y % SIDE * SIDE + x % SIDE);
            }
        });
        pixels
    }
}

fn rasterize(projected: &[Projected], view: &View) -> Rasterized {
    let tiles = Tiles::new(projected, view.width, view.height);
    let mut blended = vec![[[0f32; AREA]; 5]; tiles.count()];
    blended.par_iter_mut().enumerate().for_each(|(tile, out)| {
        Form::best().run(RasterizeTile {
            projected,
            entries: tiles.of(tile),
            corner: tiles.corner(tile),
            out,
        });
    });
    Rasterized {
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

/// Gradients from the `picture` `[H W, 4]` and the gradient to it.
fn backward(slices: &SplatSlices<'_>, picture: &[f32], grad: &[f32], view: &View) -> Gradients {
    let projected = slices.projected(view);
    let to_projected = rasterize_backward(&projected, picture, grad, view);
    let light = slices.light();
    let gradients: Vec<_> = (0..slices.count())
        .into_par_iter()
        .with_min_len(BLOCK)
        .map(|i| {
            let seen = projected[i].opacity > 0.0;
            let splat = slices.splat(i);
            seen.then(|| {
                Form::best().run(ProjectBackward {
                    splat,
                    light: &light,
                    view,
                    to: &to_projected[i],
                })
            })
        })
        .collect();
    let n = slices.count();
    let mut all = Gradients {
        transforms: vec![0.0; 12 * n],
        rows: vec![0.0; ROW * n],
        light: Vec::new(),
    };
    // In f64: every splat adds to the light.
    let mut to_light = [[0f64; LIGHTS]; 3];
    for (i, gradient) in gradients.iter().enumerate() {
        let Some(gradient) = gradient else { continue };
        all.transforms[12 * i..][..12].copy_from_slice(&gradient.transform);
        all.rows.as_chunks_mut::<ROW>().0[i] = SplatRow {
            mean: gradient.mean,
            rotation: gradient.rotation,
            scales: gradient.scale,
            opacity: gradient.opacity,
            colour: gradient.colour,
        }
        .into();
        let sums = to_light.as_flattened_mut().iter_mut();
        for (sum, term) in sums.zip(gradient.light.as_flattened()) {
            *sum += f64::from(*term);
        }
    }
    all.light = to_light.as_flattened().iter().map(|v| *v as f32).collect();
    all
}

/// Gradients to the projected splats, from the `picture` `[H W, 4]` and the gradient to it.
fn rasterize_backward(
    projected: &[Projected],
    picture: &[f32],
    grad: &[f32],
    view: &View,
) -> Vec<ProjectedGradient> {
    let tiles = Tiles::new(projected, view.width, view.height);
    let (picture, grad) = (picture.as_chunks::<4>().0, grad.as_chunks::<4>().0);
    let mut by_entry = vec![ProjectedGradient::default(); tiles.entries.len()];
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
            if x < view.width && y < view.height {
                let pixel = y * view.width + x;
                for c in 0..4 {
                    to[c][i] = grad[pixel][c];
                    dot[i] += grad[pixel][c] * picture[pixel][c];
                }
            }
        }
        Form::best().run(RasterizeTileBackward {
            projected,
            entries: tiles.of(tile),
            corner,
            grad: &to,
            dot,
            out,
        });
    });
    let mut to_projected = vec![ProjectedGradient::default(); projected.len()];
    for (entry, gradient) in tiles.entries.iter().zip(&by_entry) {
        to_projected[*entry as usize].add(gradient);
    }
    to_projected
}

impl SplatOps for Flex {
    fn splat(
        transforms: FloatTensor<Self>,
        rows: FloatTensor<Self>,
        light: FloatTensor<Self>,
        view: View,
    ) -> FloatTensor<Self> {
        let inputs = [transforms, rows, light].map(|tensor| tensor.to_contiguous());
        let tiles = rasterize(&slices(&inputs).projected(&view), &view);
        let pixels = tiles.pixels(&view, |tile, i| {
            std::array::from_fn::<_, 4, _>(|c| tile[c][i])
        });
        tensor(pixels, [view.width * view.height, 4])
    }

    fn splat_backward(
        transforms: FloatTensor<Self>,
        rows: FloatTensor<Self>,
        light: FloatTensor<Self>,
        picture: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        view: View,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        let n = rows.shape()[0];
        let inputs = [transforms, rows, light].map(|tensor| tensor.to_contiguous());
        let [picture, grad] = [picture, grad].map(|tensor| tensor.to_contiguous());
        let to = backward(&slices(&inputs), picture.storage(), grad.storage(), &view);
        (
            tensor(to.transforms, [n, 12]),
            tensor(to.rows, [n, ROW]),
            tensor(to.light, [3, LIGHTS]),
        )
    }
}

/// The contiguous inputs of the operation, in its order, as slices.
fn slices(inputs: &[FloatTensor<Flex>; 3]) -> SplatSlices<'_> {
    let [transforms, rows, light] = inputs;
    SplatSlices {
        transforms: transforms.storage(),
        rows: rows.storage(),
        light: light.storage(),
    }
}
