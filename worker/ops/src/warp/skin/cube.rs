//! Forward skinning on a GPU. The forward pass and the gradients to points have a thread per point; the other
//! gradients have a group of threads per bone and run of points, as in [`super::super::cube`].

use super::super::cube_grid::{GridPoint, Lattice, lattice, tap, untransformed_point, voxels};
use super::super::cube_rigid::{GROUP, RUN, bone_to_posed, product, rigid_inverse_backward};
use super::super::inverse::MIN_SUM;
use super::{SkinOps, WarpGrid};
use crate::cube::adding::{AddFloat, Bound, launch_adding};
use crate::cube::tensors::{each, empty, rows, zeros};
use burn::backend::tensor::FloatTensor;
use burn::tensor::Shape;
use burn_cubecl::CubeBackend;
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;

impl SkinOps for CubeBackend {
    fn skin(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grid: WarpGrid,
    ) -> FloatTensor<Self> {
        forward(weights, transforms, points, &grid)
    }

    fn skin_backward(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        grid: WarpGrid,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        backward(weights, transforms, points, grad, &grid)
    }
}

/// `[N, 12]` as in [`super::skin`].
fn forward(
    weights: CubeTensor,
    transforms: CubeTensor,
    points: CubeTensor,
    grid: &WarpGrid,
) -> CubeTensor {
    let (weights, transforms, points) = (rows(weights), rows(transforms), rows(points));
    let n = points.meta.shape()[0];
    let output = empty(&points, super::output_shape(points.meta.shape()));
    let client = output.client.clone();
    if n > 0 {
        let (count, dim) = each(&client, n);
        skin_points::launch(
            &client,
            count,
            dim,
            weights.into_buffer_arg(),
            transforms.into_buffer_arg(),
            points.into_buffer_arg(),
            output.clone().into_buffer_arg(),
            lattice(grid),
            grid.floor,
        );
    }
    output
}

/// Gradients to weights (same shape), transforms `[K, 12]` and points `[N, 3]`, from `grad` `[N, 12]`.
fn backward(
    weights: CubeTensor,
    transforms: CubeTensor,
    points: CubeTensor,
    grad: CubeTensor,
    grid: &WarpGrid,
) -> (CubeTensor, CubeTensor, CubeTensor) {
    let (weights, transforms) = (rows(weights), rows(transforms));
    let (points, grad) = (rows(points), rows(grad));
    let to_weights = zeros(&weights, weights.meta.shape().clone());
    let to_transforms = zeros(&weights, transforms.meta.shape().clone());
    let to_points = empty(&points, points.meta.shape().clone());
    let client = points.client.clone();
    let (n, bones) = (points.meta.shape()[0], transforms.meta.shape()[0]);
    if n > 0 {
        let means = empty(&points, Shape::new([n, 2]));
        let (count, dim) = each(&client, n);
        points_backward::launch(
            &client,
            count,
            dim,
            weights.clone().into_buffer_arg(),
            transforms.clone().into_buffer_arg(),
            points.clone().into_buffer_arg(),
            grad.clone().into_buffer_arg(),
            means.clone().into_buffer_arg(),
            to_points.clone().into_buffer_arg(),
            lattice(grid),
            grid.floor,
        );
        launch_adding!(
            bones_backward,
            &client,
            CubeCount::new_2d(n.div_ceil(RUN) as u32, bones as u32),
            CubeDim::new_1d(GROUP as u32),
            weights.into_buffer_arg(),
            transforms.into_buffer_arg(),
            points.into_buffer_arg(),
            grad.into_buffer_arg(),
            means.into_buffer_arg(),
            to_weights.clone().into_buffer_arg(),
            to_transforms.clone().into_buffer_arg(),
            lattice(grid),
            grid.floor,
        );
    }
    (to_weights, to_transforms, to_points)
}

/// A bone's weight at a point, 0 where it is at most `floor`.
#[cube]
fn weight(weights: &[f32], bone: usize, point: &GridPoint, lattice: &Lattice, floor: f32) -> f32 {
    let volume = bone * voxels(lattice);
    let mut sum = 0.0f32;
    for corner in 0..8u32 {
        let tap = tap(point, corner, lattice);
        if tap.inside {
            sum += tap.u * tap.v * tap.w * weights[volume + tap.node];
        }
    }
    if sum <= floor {
        sum = 0.0;
    }
    sum
}

/// Writes Σ wᵢ Gᵢ with wᵢ = vᵢ / Σ v, `[N, 12]`. A thread per point.
#[cube(launch)]
fn skin_points(
    weights: &[f32],
    transforms: &[f32],
    points: &[f32],
    output: &mut [f32],
    lattice: &Lattice,
    floor: f32,
) {
    let i = ABSOLUTE_POS;
    if i >= points.len() / 3 {
        terminate!();
    }
    let point = untransformed_point(points, i, lattice);
    let mut blend = Array::<f32>::new(12usize);
    #[unroll]
    for k in 0..12usize {
        blend[k] = 0.0;
    }
    let mut sum = 0.0f32;
    if point.inside {
        for bone in 0..transforms.len() / 12 {
            let weight = weight(weights, bone, &point, lattice, floor);
            if weight > 0.0 {
                sum += weight;
                let bone_to_posed = bone_to_posed(transforms, bone);
                #[unroll]
                for k in 0..12usize {
                    blend[k] += weight * bone_to_posed[k];
                }
            }
        }
    }
    if sum > MIN_SUM {
        #[unroll]
        for k in 0..12usize {
            output[12 * i + k] = blend[k] / sum;
        }
    } else {
        let bone_to_posed = bone_to_posed(transforms, 0usize);
        #[unroll]
        for k in 0..12usize {
            output[12 * i + k] = bone_to_posed[k];
        }
    }
}

/// Writes the gradients to the points `[N, 3]`, and `means` `[N, 2]`, the part of a point's gradient that all bones
/// share: 1 / Σ v, and the inner product of the gradient and the blend. The first is 0 where the gradient is exactly
/// zero, and −1 where no bone has a weight. The derivative of Σ wᵢ Gᵢ with wᵢ = vᵢ / Σ v with respect to vᵢ is
/// (Gᵢ − Σ wⱼ Gⱼ) / Σ v.
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
fn points_backward(
    weights: &[f32],
    transforms: &[f32],
    points: &[f32],
    grad: &[f32],
    means: &mut [f32],
    to_points: &mut [f32],
    lattice: &Lattice,
    floor: f32,
) {
    let i = ABSOLUTE_POS;
    if i >= points.len() / 3 {
        terminate!();
    }
    let bones = transforms.len() / 12;
    let voxels = voxels(lattice);
    let mut has_grad = false;
    #[unroll]
    for k in 0..12usize {
        has_grad = has_grad || grad[12 * i + k] != 0.0;
    }
    let point = untransformed_point(points, i, lattice);
    let mut sum = 0.0f32;
    let mut mean = 0.0f32;
    if has_grad && point.inside {
        for bone in 0..bones {
            let weight = weight(weights, bone, &point, lattice, floor);
            if weight > 0.0 {
                sum += weight;
                mean += weight * product(grad, i, &bone_to_posed(transforms, bone));
            }
        }
    }
    let mut inverse = 0.0f32;
    let mut to_x = 0.0f32;
    let mut to_y = 0.0f32;
    let mut to_z = 0.0f32;
    if sum > MIN_SUM {
        inverse = 1.0 / sum;
        mean *= inverse;
        for bone in 0..bones {
            if weight(weights, bone, &point, lattice, floor) > 0.0 {
                // ∂L/∂c = Σ ∂L/∂vᵢ ∇vᵢ(c)
                let by = (product(grad, i, &bone_to_posed(transforms, bone)) - mean) * inverse;
                for corner in 0..8u32 {
                    let tap = tap(&point, corner, lattice);
                    if tap.inside {
                        let value = by * weights[bone * voxels + tap.node];
                        to_x += tap.du * tap.v * tap.w * value;
                        to_y += tap.u * tap.dv * tap.w * value;
                        to_z += tap.u * tap.v * tap.dw * value;
                    }
                }
            }
        }
    } else if has_grad {
        inverse = -1.0f32;
    }
    means[2 * i] = inverse;
    means[2 * i + 1] = mean;
    to_points[3 * i] = to_x * lattice.scale_x;
    to_points[3 * i + 1] = to_y * lattice.scale_y;
    to_points[3 * i + 2] = to_z * lattice.scale_z;
}

/// Adds the gradients to weights and transforms. A group of threads per run of points (x) and bone (y).
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
fn bones_backward<A: AddFloat>(
    weights: &[f32],
    transforms: &[f32],
    points: &[f32],
    grad: &[f32],
    means: &[f32],
    to_weights: &mut [Atomic<Bound<A>>],
    to_transforms: &mut [Atomic<Bound<A>>],
    lattice: &Lattice,
    floor: f32,
) {
    let n = points.len() / 3;
    let bone = CUBE_POS_Y as usize;
    let volume = bone * voxels(lattice);
    let unit = UNIT_POS as usize;
    let first = CUBE_POS_X as usize * RUN;
    let bone_to_posed = bone_to_posed(transforms, bone);
    let mut own = Array::<f32>::new(12usize);
    #[unroll]
    for k in 0..12usize {
        own[k] = 0.0;
    }
    for step in 0..RUN / GROUP {
        let i = first + step * GROUP + unit;
        let mut inverse = 0.0f32;
        if i < n {
            inverse = means[2 * i];
        }
        let mut normalized = 0.0f32;
        if inverse > 0.0 {
            let point = untransformed_point(points, i, lattice);
            let weight = weight(weights, bone, &point, lattice, floor);
            if weight > 0.0 {
                normalized = weight * inverse;
                // ∂L/∂vᵢ = ⟨∂L/∂G, Gᵢ − Σ wⱼ Gⱼ⟩ / Σ v
                let to_weight = (product(grad, i, &bone_to_posed) - means[2 * i + 1]) * inverse;
                for corner in 0..8u32 {
                    let tap = tap(&point, corner, lattice);
                    if tap.inside {
                        A::add(
                            &mut to_weights[volume + tap.node],
                            tap.u * tap.v * tap.w * to_weight,
                        );
                    }
                }
            }
        } else if inverse < 0.0 && bone == 0 {
            normalized = 1.0;
        }
        if normalized > 0.0 {
            #[unroll]
            for k in 0..12usize {
                own[k] += normalized * grad[12 * i + k];
            }
        }
    }
    rigid_inverse_backward::<A>(&own, transforms, bone, to_transforms);
}
