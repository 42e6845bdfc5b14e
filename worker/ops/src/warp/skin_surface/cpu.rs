//! Forward skinning of a surface on CPU threads. The backward pass runs over points, then over bones, so that the order
//! of sums does not depend on the number of threads.

use super::super::influences::{AllInfluences, Influence, Influences, dot};
use super::super::inverse::solve::rigid_inverse;
use super::surface::PointWeights;
pub use super::surface::Surface;
use super::{SkinSurfaceOps, WarpGrid};
use crate::flex::tensor;
use crate::form::{Form, Work, multiply_add};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Flex, TensorMetadata};
use rayon::prelude::*;

/// Points per task.
const BLOCK: usize = 512;

impl SkinSurfaceOps for Flex {
    fn skin_surface(
        factors: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        bones: FloatTensor<Self>,
        weights: FloatTensor<Self>,
        factored: usize,
        grid: WarpGrid,
    ) -> FloatTensor<Self> {
        let [n, width] = bones.shape().dims();
        let [factors, transforms, points, bones, weights] =
            [factors, transforms, points, bones, weights].map(|tensor| tensor.to_contiguous());
        let surface = Surface::new(
            factors.storage(),
            factored,
            bones.storage(),
            weights.storage(),
            width,
            &grid,
        );
        let blended = forward(&surface, transforms.storage(), points.storage());
        tensor(blended, [n, 12])
    }

    fn skin_surface_backward(
        factors: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        bones: FloatTensor<Self>,
        weights: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        factored: usize,
        grid: WarpGrid,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        let ([rows, voxels], count) = (factors.shape().dims(), transforms.shape()[0]);
        let [n, width] = bones.shape().dims();
        let [factors, transforms, points, bones, weights, grad] =
            [factors, transforms, points, bones, weights, grad]
                .map(|tensor| tensor.to_contiguous());
        let surface = Surface::new(
            factors.storage(),
            factored,
            bones.storage(),
            weights.storage(),
            width,
            &grid,
        );
        let gradients = backward(
            &surface,
            transforms.storage(),
            points.storage(),
            grad.storage(),
        );
        (
            tensor(gradients.factors, [rows, voxels]),
            tensor(gradients.transforms, [count, 12]),
            tensor(gradients.points, [n, 3]),
        )
    }
}

/// Checks that there is a transform for each bone of the surface, and a canonical point for each point.
///
/// # Panics
/// If not.
fn check(surface: &Surface<'_>, transforms: &[f32], points: &[f32]) {
    surface.check_bones(transforms.len() / 12);
    let n = surface.points();
    assert_eq!(points.len(), 3 * n, "coordinates of {n} points");
}

/// Canonical to posed `[N, 12]`, as [`super::skin_surface`] of slices.
///
/// # Panics
/// If `points` are not as many as those of the surface, or one of its bones has no transform.
pub fn forward(surface: &Surface<'_>, transforms: &[f32], points: &[f32]) -> Vec<f32> {
    check(surface, transforms, points);
    let bones = transforms.as_chunks::<12>().0.iter();
    let bones: Vec<[f32; 12]> = bones.map(rigid_inverse).collect();
    let points = points.as_chunks::<3>().0;
    let mut blended = vec![0f32; 12 * points.len()];
    let rows = blended.as_chunks_mut::<12>().0;
    rows.par_chunks_mut(BLOCK)
        .zip(points.par_chunks(BLOCK))
        .enumerate()
        .for_each(|(block, (rows, points))| {
            Form::best().run(Blends {
                surface,
                forward: &bones,
                first: block * BLOCK,
                points,
                rows,
            });
        });
    blended
}

/// Blends the transforms of some points.
struct Blends<'s, 'a> {
    surface: &'s Surface<'a>,
    forward: &'s [[f32; 12]],
    first: usize,
    points: &'s [[f32; 3]],
    rows: &'s mut [[f32; 12]],
}

impl Work for Blends<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        for (i, (row, at)) in self.rows.iter_mut().zip(self.points).enumerate() {
            let weights = self.surface.weights_at(self.first + i, *at);
            *row = blend::<FMA>(&weights, self.forward);
        }
    }
}

/// Σ wᵢ Gᵢ
#[inline(always)]
fn blend<const FMA: bool>(weights: &PointWeights, forward: &[[f32; 12]]) -> [f32; 12] {
    let mut transform = [0f32; 12];
    for share in weights.shares() {
        for (to, from) in transform.iter_mut().zip(&forward[share.bone]) {
            *to = multiply_add::<FMA>(share.weight, *from, *to);
        }
    }
    transform
}

/// Gradients to the inputs, of their shapes.
struct Gradients {
    factors: Vec<f32>,
    transforms: Vec<f32>,
    points: Vec<f32>,
}

fn backward(surface: &Surface<'_>, transforms: &[f32], points: &[f32], grad: &[f32]) -> Gradients {
    check(surface, transforms, points);
    let bones = transforms.as_chunks::<12>().0;
    let forward: Vec<[f32; 12]> = bones.iter().map(rigid_inverse).collect();
    let (at, grad) = (points.as_chunks::<3>().0, grad.as_chunks::<12>().0);
    let mut to_points = vec![0f32; points.len()];
    let pulled = to_points.as_chunks_mut::<3>().0;
    let blocks: Vec<Influences> = at
        .par_chunks(BLOCK)
        .zip(grad.par_chunks(BLOCK))
        .zip(pulled.par_chunks_mut(BLOCK))
        .enumerate()
        .map(|(block, ((at, grad), to_points))| {
            Form::best().run(InfluenceBlock {
                surface,
                forward: &forward,
                first: block * BLOCK,
                points: at,
                grad,
                to_points,
            })
        })
        .collect();
    let influences = AllInfluences {
        blocks: &blocks,
        grad,
        bones,
        volumes: surface.factors(),
        grid: surface.grid(),
    };
    let (to_factors, to_transforms) = influences.sum_by_bone(|point| surface.cell(at[point]));
    Gradients {
        factors: to_factors,
        transforms: to_transforms,
        points: to_points,
    }
}

/// The influences of a block of points.
struct InfluenceBlock<'s, 'a> {
    surface: &'s Surface<'a>,
    forward: &'s [[f32; 12]],
    first: usize,
    points: &'s [[f32; 3]],
    grad: &'s [[f32; 12]],
    to_points: &'s mut [[f32; 3]],
}

impl Work for InfluenceBlock<'_, '_> {
    type Output = Influences;

    #[inline(always)]
    fn run<const FMA: bool>(self) -> Influences {
        influences::<FMA>(self)
    }
}

/// The influences at a block of points, and the gradients to the points. The derivative of Σ wᵢ Gᵢ with
/// wᵢ = bᵢ fᵢ / Σ b f with respect to fᵢ is bᵢ (Gᵢ − Σ wⱼ Gⱼ) / Σ b f.
#[inline(always)]
fn influences<const FMA: bool>(block: InfluenceBlock<'_, '_>) -> Influences {
    let InfluenceBlock {
        surface,
        forward,
        first,
        points,
        grad,
        to_points,
    } = block;
    let mut influences: Influences = forward.iter().map(|_| Vec::new()).collect();
    for (i, ((at, grad), to_point)) in points.iter().zip(grad).zip(to_points).enumerate() {
        if *grad == [0.0; 12] {
            continue;
        }
        let point = first + i;
        let weights = surface.weights_at(point, *at);
        let mean = dot(grad, &blend::<FMA>(&weights, forward));
        for share in weights.shares() {
            let mut to_factor = 0.0;
            if let Some((cell, sum)) = &weights.learned
                && let Some(slope) = surface.slope(share.bone, cell)
            {
                // ∂L/∂fᵢ = bᵢ ⟨∂L/∂G, Gᵢ − Σ wⱼ Gⱼ⟩ / Σ b f
                to_factor = share.base * (dot(grad, &forward[share.bone]) - mean) / sum;
                // ∂L/∂x = Σ ∂L/∂fᵢ ∇fᵢ(x)
                for (to, slope) in to_point.iter_mut().zip(slope) {
                    *to += to_factor * slope;
                }
            }
            influences[share.bone].push(Influence {
                point: point as u32,
                weight: share.weight,
                to_value: to_factor,
            });
        }
    }
    influences
}
