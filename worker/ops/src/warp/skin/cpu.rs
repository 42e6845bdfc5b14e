//! Forward skinning on CPU threads. The backward pass runs over points, then over bones, so that the
//! order of sums does not depend on the number of threads.

use super::super::influences::{AllInfluences, Influence, Influences, dot};
use super::super::inverse::solve::Skinning;
use super::{SkinOps, WarpGrid};
use crate::flex::tensor;
use crate::form::{Form, Work};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Flex, TensorMetadata};
use rayon::prelude::*;

/// Points per task.
const BLOCK: usize = 512;

impl SkinOps for Flex {
    fn skin(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grid: WarpGrid,
    ) -> FloatTensor<Self> {
        let n = points.shape()[0];
        let [weights, transforms, points] =
            [weights, transforms, points].map(|tensor| tensor.to_contiguous());
        let blended = forward(
            weights.storage(),
            transforms.storage(),
            points.storage(),
            &grid,
        );
        tensor(blended, [n, 12])
    }

    fn skin_backward(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        grid: WarpGrid,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        let [rows, voxels] = weights.shape().dims();
        let (bones, n) = (transforms.shape()[0], points.shape()[0]);
        let [weights, transforms, points, grad] =
            [weights, transforms, points, grad].map(|tensor| tensor.to_contiguous());
        let gradients = backward(
            weights.storage(),
            transforms.storage(),
            points.storage(),
            grad.storage(),
            &grid,
        );
        (
            tensor(gradients.weights, [rows, voxels]),
            tensor(gradients.transforms, [bones, 12]),
            tensor(gradients.points, [n, 3]),
        )
    }
}

/// Canonical to posed `[N, 12]`, as [`super::skin`] of slices.
pub fn forward(weights: &[f32], transforms: &[f32], points: &[f32], grid: &WarpGrid) -> Vec<f32> {
    let skinning = Skinning::new(weights, transforms, grid);
    let points = points.as_chunks::<3>().0;
    let mut blended = vec![0f32; 12 * points.len()];
    let rows = blended.as_chunks_mut::<12>().0;
    rows.par_chunks_mut(BLOCK)
        .zip(points.par_chunks(BLOCK))
        .for_each(|(rows, points)| {
            Form::best().run(Blends {
                skinning: &skinning,
                points,
                rows,
            });
        });
    blended
}

/// Blends the transforms of some points.
struct Blends<'s, 'a> {
    skinning: &'s Skinning<'a>,
    points: &'s [[f32; 3]],
    rows: &'s mut [[f32; 12]],
}

impl Work for Blends<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        for (row, at) in self.rows.iter_mut().zip(self.points) {
            *row = match self.skinning.blend::<FMA>(*at) {
                Some(blend) => blend.transform,
                None => self.skinning.forward[0],
            };
        }
    }
}

/// Gradients to the inputs, of their shapes.
struct Gradients {
    weights: Vec<f32>,
    transforms: Vec<f32>,
    points: Vec<f32>,
}

fn backward(
    weights: &[f32],
    transforms: &[f32],
    points: &[f32],
    grad: &[f32],
    grid: &WarpGrid,
) -> Gradients {
    let skinning = Skinning::new(weights, transforms, grid);
    let bones = transforms.as_chunks::<12>().0;
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
                skinning: &skinning,
                bones: bones.len(),
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
        volumes: weights,
        grid,
    };
    let (to_weights, to_transforms) = influences.sum_by_bone(|point| skinning.cell(at[point]));
    Gradients {
        weights: to_weights,
        transforms: to_transforms,
        points: to_points,
    }
}

/// The influences of a block of points.
struct InfluenceBlock<'s, 'a> {
    skinning: &'s Skinning<'a>,
    bones: usize,
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
/// wᵢ = vᵢ / Σ v with respect to vᵢ is (Gᵢ − Σ wⱼ Gⱼ) / Σ v.
#[inline(always)]
fn influences<const FMA: bool>(block: InfluenceBlock<'_, '_>) -> Influences {
    let InfluenceBlock {
        skinning,
        bones,
        first,
        points,
        grad,
        to_points,
    } = block;
    let mut influences: Influences = (0..bones).map(|_| Vec::new()).collect();
    for (i, ((at, grad), to_point)) in points.iter().zip(grad).zip(to_points).enumerate() {
        if *grad == [0.0; 12] {
            continue;
        }
        let point = (first + i) as u32;
        let blended = skinning.cell(*at).zip(skinning.blend::<FMA>(*at));
        let Some((cell, blend)) = blended else {
            influences[0].push(Influence {
                point,
                weight: 1.0,
                to_value: 0.0,
            });
            continue;
        };
        let mean = dot(grad, &blend.transform);
        skinning.each_weight::<FMA>(&cell, |bone, weight| {
            // ∂L/∂vᵢ = ⟨∂L/∂G, Gᵢ − Σ wⱼ Gⱼ⟩ / Σ v
            let to_weight = (dot(grad, &skinning.forward[bone]) - mean) / blend.sum;
            // ∂L/∂c = Σ ∂L/∂vᵢ ∇vᵢ(c)
            let slope = skinning.slope(bone, &cell);
            for (to, slope) in to_point.iter_mut().zip(slope) {
                *to += to_weight * slope;
            }
            influences[bone].push(Influence {
                point,
                weight: weight / blend.sum,
                to_value: to_weight,
            });
        });
    }
    influences
}
