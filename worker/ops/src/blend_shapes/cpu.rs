//! The offsets on CPU threads: point by point, in sums that stay in registers, over the joints that are near.

use super::BlendShapesOps;
use crate::flex::tensor;
use crate::form::{Form, Work, multiply_add};
use burn::backend::{Flex, TensorMetadata, tensor::FloatTensor};
use rayon::prelude::*;

/// Points per task. It does not depend on the number of threads, so that sums over points do not either.
const BLOCK: usize = 1024;

impl BlendShapesOps for Flex {
    fn blend_shapes(
        near: FloatTensor<Self>,
        by_joint: FloatTensor<Self>,
        weights: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let [points, shapes] = weights.shape().dims();
        let [near, by_joint, weights] = [near, by_joint, weights].map(|it| it.to_contiguous());
        let from = Shapes {
            by_joint: by_joint.storage(),
            shapes,
        };
        tensor(
            forward(&from, near.storage(), weights.storage()),
            [points, 3],
        )
    }

    fn blend_shapes_backward(
        near: FloatTensor<Self>,
        by_joint: FloatTensor<Self>,
        weights: FloatTensor<Self>,
        grad: FloatTensor<Self>,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        let [points, shapes] = weights.shape().dims();
        let [joints, width] = by_joint.shape().dims();
        let [near, by_joint, weights, grad] =
            [near, by_joint, weights, grad].map(|it| it.to_contiguous());
        let from = Shapes {
            by_joint: by_joint.storage(),
            shapes,
        };
        let (to_joints, to_weights) =
            backward(&from, near.storage(), weights.storage(), grad.storage());
        (
            tensor(to_joints, [joints, width]),
            tensor(to_weights, [points, shapes]),
        )
    }
}

/// What joints give, G.
pub struct Shapes<'a> {
    /// `[K, 3 R]`.
    pub by_joint: &'a [f32],
    /// R.
    pub shapes: usize,
}

impl Shapes<'_> {
    /// 3 R.
    fn width(&self) -> usize {
        3 * self.shapes
    }

    /// K.
    fn joints(&self) -> usize {
        self.by_joint.len() / self.width().max(1)
    }

    /// The number of points.
    ///
    /// # Panics
    /// If the sizes do not fit one another.
    fn points(&self, near: &[f32], weights: &[f32]) -> usize {
        let (joints, shapes) = (self.joints(), self.shapes);
        assert!(
            shapes > 0 && joints > 0 && self.by_joint.len() == joints * self.width(),
            "{} numbers for {shapes} shapes",
            self.by_joint.len()
        );
        let points = weights.len() / shapes;
        assert!(
            weights.len() == points * shapes && near.len() == points * joints,
            "{} weights and {} distances for {shapes} shapes and {joints} joints",
            weights.len(),
            near.len()
        );
        points
    }

    /// Σₖ aₖ Gₖ `[3 R]` of a point.
    #[inline(always)]
    fn sum<const FMA: bool>(&self, near: &[f32], sum: &mut [f32]) {
        sum.fill(0.0);
        for (share, given) in near.iter().zip(self.by_joint.chunks_exact(sum.len())) {
            if *share != 0.0 {
                add::<FMA>(sum, *share, given);
            }
        }
    }
}

/// Adds `factor` times `from` to `to`.
#[inline(always)]
fn add<const FMA: bool>(to: &mut [f32], factor: f32, from: &[f32]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to = multiply_add::<FMA>(factor, *from, *to);
    }
}

/// Offsets `[N, 3]` from nearness `[N, K]` and weights `[N, R]`.
///
/// # Panics
/// If the sizes do not fit one another.
pub fn forward(shapes: &Shapes<'_>, near: &[f32], weights: &[f32]) -> Vec<f32> {
    let mut moved = vec![0f32; 3 * shapes.points(near, weights)];
    let blocks = moved
        .par_chunks_mut(3 * BLOCK)
        .zip(near.par_chunks(shapes.joints() * BLOCK))
        .zip(weights.par_chunks(shapes.shapes * BLOCK));
    blocks.for_each(|((moved, near), weights)| {
        Form::best().run(Forward {
            shapes,
            near,
            weights,
            moved,
        });
    });
    moved
}

struct Forward<'a> {
    shapes: &'a Shapes<'a>,
    near: &'a [f32],
    weights: &'a [f32],
    moved: &'a mut [f32],
}

impl Work for Forward<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        let (joints, count) = (self.shapes.joints(), self.shapes.shapes);
        let mut sum = vec![0f32; self.shapes.width()];
        let near = self.near.chunks_exact(joints);
        let points = near.zip(self.weights.chunks_exact(count));
        let moved = self.moved.as_chunks_mut::<3>().0.iter_mut();
        for ((near, weights), moved) in points.zip(moved) {
            self.shapes.sum::<FMA>(near, &mut sum);
            for (moved, sum) in moved.iter_mut().zip(sum.chunks_exact(count)) {
                // Δ = Σᵣ hᵣ Σₖ aₖ Gₖᵣ
                for (sum, weight) in sum.iter().zip(weights) {
                    *moved = multiply_add::<FMA>(*sum, *weight, *moved);
                }
            }
        }
    }
}

/// Gradients to G `[K, 3 R]` and to the weights `[N, R]`, from `grad` `[N, 3]`.
///
/// # Panics
/// If the sizes do not fit one another.
pub fn backward(
    shapes: &Shapes<'_>,
    near: &[f32],
    weights: &[f32],
    grad: &[f32],
) -> (Vec<f32>, Vec<f32>) {
    let points = shapes.points(near, weights);
    assert_eq!(grad.len(), 3 * points, "gradients of {points} points");
    let mut to_weights = vec![0f32; weights.len()];
    let blocks = to_weights
        .par_chunks_mut(shapes.shapes * BLOCK)
        .zip(near.par_chunks(shapes.joints() * BLOCK))
        .zip(weights.par_chunks(shapes.shapes * BLOCK))
        .zip(grad.par_chunks(3 * BLOCK));
    let by_block: Vec<Vec<f32>> = blocks
        .map(|(((to_weights, near), weights), grad)| {
            Form::best().run(Backward {
                shapes,
                near,
                weights,
                grad,
                to_weights,
            })
        })
        .collect();
    let mut to_joints = vec![0f32; shapes.by_joint.len()];
    for block in by_block {
        for (sum, part) in to_joints.iter_mut().zip(block) {
            *sum += part;
        }
    }
    (to_joints, to_weights)
}

struct Backward<'a> {
    shapes: &'a Shapes<'a>,
    near: &'a [f32],
    weights: &'a [f32],
    grad: &'a [f32],
    to_weights: &'a mut [f32],
}

impl Work for Backward<'_> {
    /// Gradient to G `[K, 3 R]` of the block.
    type Output = Vec<f32>;

    #[inline(always)]
    fn run<const FMA: bool>(self) -> Vec<f32> {
        let (joints, count) = (self.shapes.joints(), self.shapes.shapes);
        let width = self.shapes.width();
        let mut to_joints = vec![0f32; joints * width];
        let (mut sum, mut to_sum) = (vec![0f32; width], vec![0f32; width]);
        let near = self.near.chunks_exact(joints);
        let points = near.zip(self.weights.chunks_exact(count));
        let grads = self.grad.as_chunks::<3>().0.iter();
        let to_weights = self.to_weights.chunks_exact_mut(count);
        for ((near, weights), (grad, to_weights)) in points.zip(grads.zip(to_weights)) {
            self.shapes.sum::<FMA>(near, &mut sum);
            let coordinates = sum.chunks_exact(count).zip(to_sum.chunks_exact_mut(count));
            for (grad, (sum, to_sum)) in grad.iter().zip(coordinates) {
                // ∂L/∂hᵣ = Σ g Σₖ aₖ Gₖᵣ
                add::<FMA>(to_weights, *grad, sum);
                // ∂L/∂(Σₖ aₖ Gₖᵣ) = g hᵣ
                for (to_sum, weight) in to_sum.iter_mut().zip(weights) {
                    *to_sum = grad * weight;
                }
            }
            for (share, to_given) in near.iter().zip(to_joints.chunks_exact_mut(width)) {
                if *share != 0.0 {
                    add::<FMA>(to_given, *share, &to_sum);
                }
            }
        }
        to_joints
    }
}
