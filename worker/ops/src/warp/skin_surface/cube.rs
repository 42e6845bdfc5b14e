//! Forward skinning of a surface on a GPU. The forward pass and the gradients to points have a thread per point; the
//! other gradients have a group of threads per bone and run of points, as in [`super::super::skin`].

use super::super::cube_grid::{GridPoint, Lattice, lattice, point_in_box, tap, voxels};
use super::super::cube_rigid::{GROUP, RUN, bone_to_posed, product, rigid_inverse_backward};
use super::{MIN_SUM, SkinSurfaceOps, WarpGrid};
use crate::cube::adding::{AddFloat, Bound, launch_adding};
use crate::cube::tensors::{each, empty, rows, zeros};
use burn::backend::tensor::FloatTensor;
use burn::tensor::Shape;
use burn_cubecl::CubeBackend;
use cubecl::prelude::*;

impl SkinSurfaceOps for CubeBackend {
    fn skin_surface(
        factors: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        bones: FloatTensor<Self>,
        weights: FloatTensor<Self>,
        factored: usize,
        grid: WarpGrid,
    ) -> FloatTensor<Self> {
        let [factors, transforms, points, bones, weights] =
            [factors, transforms, points, bones, weights].map(rows);
        let n = points.meta.shape()[0];
        let output = empty(&points, super::output_shape(points.meta.shape()));
        let client = output.client.clone();
        if n > 0 {
            let (count, dim) = each(&client, n);
            skin_points::launch(
                &client,
                count,
                dim,
                factors.into_buffer_arg(),
                transforms.into_buffer_arg(),
                points.into_buffer_arg(),
                bones.into_buffer_arg(),
                weights.into_buffer_arg(),
                output.clone().into_buffer_arg(),
                factored as u32,
                lattice(&grid),
            );
        }
        output
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
        let [factors, transforms, points, bones, weights, grad] =
            [factors, transforms, points, bones, weights, grad].map(rows);
        let to_factors = zeros(&factors, factors.meta.shape().clone());
        let to_transforms = zeros(&factors, transforms.meta.shape().clone());
        let to_points = empty(&points, points.meta.shape().clone());
        let client = points.client.clone();
        let [n, width] = bones.meta.shape().dims();
        if n > 0 {
            let shares = empty(&points, Shape::new([n, width, 2]));
            let (count, dim) = each(&client, n);
            points_backward::launch(
                &client,
                count,
                dim,
                factors.into_buffer_arg(),
                transforms.clone().into_buffer_arg(),
                points.clone().into_buffer_arg(),
                bones.clone().into_buffer_arg(),
                weights.into_buffer_arg(),
                grad.clone().into_buffer_arg(),
                shares.clone().into_buffer_arg(),
                to_points.clone().into_buffer_arg(),
                factored as u32,
                lattice(&grid),
            );
            launch_adding!(
                bones_backward,
                &client,
                CubeCount::new_2d(n.div_ceil(RUN) as u32, transforms.meta.shape()[0] as u32),
                CubeDim::new_1d(GROUP as u32),
                transforms.into_buffer_arg(),
                points.into_buffer_arg(),
                bones.into_buffer_arg(),
                grad.into_buffer_arg(),
                shares.into_buffer_arg(),
                to_factors.clone().into_buffer_arg(),
                to_transforms.clone().into_buffer_arg(),
                lattice(&grid),
            );
        }
        (to_factors, to_transforms, to_points)
    }
}

/// A bone's factor at a point inside the box: 1 of bones after the first `factored`.
#[cube]
fn factor(
    factors: &[f32],
    bone: usize,
    point: &GridPoint,
    factored: u32,
    lattice: &Lattice,
) -> f32 {
    let mut sum = 1.0f32;
    if bone < factored as usize {
        sum = 0.0f32;
        let volume = bone * voxels(lattice);
        for corner in 0..8u32 {
            let tap = tap(point, corner, lattice);
            if tap.inside {
                sum += tap.u * tap.v * tap.w * factors[volume + tap.node];
            }
        }
    }
    sum
}

/// Σ bⱼ fⱼ over the entries from `first` to `end`, those of a point; 0 where its weights are the base weights.
#[cube]
#[allow(clippy::too_many_arguments)]
fn sum_of_weights(
    factors: &[f32],
    bones: &[f32],
    weights: &[f32],
    first: usize,
    end: usize,
    point: &GridPoint,
    factored: u32,
    lattice: &Lattice,
) -> f32 {
    let mut sum = 0.0f32;
    if point.inside {
        for at in first..end {
            let base = weights[at];
            if base != 0.0 {
                let bone = usize::cast_from(bones[at]);
                sum += base * factor(factors, bone, point, factored, lattice);
            }
        }
    }
    // Comparisons are false for a NaN.
    let mut learned = 0.0f32;
    if sum >= MIN_SUM {
        learned = sum;
    }
    learned
}

/// The normalised weight of a bone with the base weight `base`, where `sum` is that of `sum_of_weights`.
#[cube]
fn normalized(
    factors: &[f32],
    bone: usize,
    base: f32,
    sum: f32,
    point: &GridPoint,
    factored: u32,
    lattice: &Lattice,
) -> f32 {
    let mut weight = base;
    if sum > 0.0 {
        weight = base * factor(factors, bone, point, factored, lattice) / sum;
    }
    weight
}

/// Writes Σ wᵢ Gᵢ with wᵢ = bᵢ fᵢ / Σ bⱼ fⱼ, `[N, 12]`. A thread per point.
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
fn skin_points(
    factors: &[f32],
    transforms: &[f32],
    points: &[f32],
    bones: &[f32],
    weights: &[f32],
    output: &mut [f32],
    factored: u32,
    lattice: &Lattice,
) {
    let i = ABSOLUTE_POS;
    let n = points.len() / 3;
    if i >= n {
        terminate!();
    }
    let width = bones.len() / n;
    let (first, end) = (width * i, width * i + width);
    let point = point_in_box(points, i, lattice);
    let sum = sum_of_weights(
        factors, bones, weights, first, end, &point, factored, lattice,
    );
    let mut blend = Array::<f32>::new(12usize);
    #[unroll]
    for k in 0..12usize {
        blend[k] = 0.0;
    }
    for at in first..end {
        let base = weights[at];
        if base != 0.0 {
            let bone = usize::cast_from(bones[at]);
            let weight = normalized(factors, bone, base, sum, &point, factored, lattice);
            let bone_to_posed = bone_to_posed(transforms, bone);
            #[unroll]
            for k in 0..12usize {
                blend[k] += weight * bone_to_posed[k];
            }
        }
    }
    #[unroll]
    for k in 0..12usize {
        output[12 * i + k] = blend[k];
    }
}

/// Writes the gradients to the points `[N, 3]`, and `shares` `[N, B, 2]`: the normalised weight of each bone of a point,
/// and the gradient to its factor. Both are 0 where the gradient to the result is exactly zero. The derivative of
/// Σ wᵢ Gᵢ with wᵢ = bᵢ fᵢ / Σ b f with respect to fᵢ is bᵢ (Gᵢ − Σ wⱼ Gⱼ) / Σ b f. A thread per point.
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
fn points_backward(
    factors: &[f32],
    transforms: &[f32],
    points: &[f32],
    bones: &[f32],
    weights: &[f32],
    grad: &[f32],
    shares: &mut [f32],
    to_points: &mut [f32],
    factored: u32,
    lattice: &Lattice,
) {
    let i = ABSOLUTE_POS;
    let n = points.len() / 3;
    if i >= n {
        terminate!();
    }
    let width = bones.len() / n;
    let (first, end) = (width * i, width * i + width);
    let mut has_grad = false;
    #[unroll]
    for k in 0..12usize {
        has_grad = has_grad || grad[12 * i + k] != 0.0;
    }
    let point = point_in_box(points, i, lattice);
    let mut sum = 0.0f32;
    let mut mean = 0.0f32;
    for at in first..end {
        shares[2 * at] = 0.0;
        shares[2 * at + 1] = 0.0;
    }
    if has_grad {
        sum = sum_of_weights(
            factors, bones, weights, first, end, &point, factored, lattice,
        );
        for at in first..end {
            let base = weights[at];
            if base != 0.0 {
                let bone = usize::cast_from(bones[at]);
                let weight = normalized(factors, bone, base, sum, &point, factored, lattice);
                shares[2 * at] = weight;
                mean += weight * product(grad, i, &bone_to_posed(transforms, bone));
            }
        }
    }
    let mut to_x = 0.0f32;
    let mut to_y = 0.0f32;
    let mut to_z = 0.0f32;
    if sum > 0.0 {
        for at in first..end {
            let base = weights[at];
            if base != 0.0 {
                let bone = usize::cast_from(bones[at]);
                if bone < factored as usize {
                    // ∂L/∂fᵢ = bᵢ ⟨∂L/∂G, Gᵢ − Σ wⱼ Gⱼ⟩ / Σ b f
                    let along = product(grad, i, &bone_to_posed(transforms, bone)) - mean;
                    let to_factor = base * along / sum;
                    shares[2 * at + 1] = to_factor;
                    // ∂L/∂x = Σ ∂L/∂fᵢ ∇fᵢ(x)
                    let volume = bone * voxels(lattice);
                    for corner in 0..8u32 {
                        let tap = tap(&point, corner, lattice);
                        if tap.inside {
                            let value = to_factor * factors[volume + tap.node];
                            to_x += tap.du * tap.v * tap.w * value;
                            to_y += tap.u * tap.dv * tap.w * value;
                            to_z += tap.u * tap.v * tap.dw * value;
                        }
                    }
                }
            }
        }
    }
    to_points[3 * i] = to_x * lattice.scale_x;
    to_points[3 * i + 1] = to_y * lattice.scale_y;
    to_points[3 * i + 2] = to_z * lattice.scale_z;
}

/// Adds the gradients to factors and transforms, from the `shares` of `points_backward`. A group of threads per run
/// of points (x) and bone (y).
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
fn bones_backward<A: AddFloat>(
    transforms: &[f32],
    points: &[f32],
    bones: &[f32],
    grad: &[f32],
    shares: &[f32],
    to_factors: &mut [Atomic<Bound<A>>],
    to_transforms: &mut [Atomic<Bound<A>>],
    lattice: &Lattice,
) {
    let n = points.len() / 3;
    let width = bones.len() / n;
    let bone = CUBE_POS_Y as usize;
    let volume = bone * voxels(lattice);
    let first = CUBE_POS_X as usize * RUN + UNIT_POS as usize;
    let mut own = Array::<f32>::new(12usize);
    #[unroll]
    for k in 0..12usize {
        own[k] = 0.0;
    }
    for step in 0..RUN / GROUP {
        let i = first + step * GROUP;
        let mut weight = 0.0f32;
        let mut to_factor = 0.0f32;
        if i < n {
            for at in width * i..width * i + width {
                if bones[at] == f32::cast_from(bone) {
                    weight += shares[2 * at];
                    to_factor += shares[2 * at + 1];
                }
            }
        }
        if weight != 0.0 {
            #[unroll]
            for k in 0..12usize {
                own[k] += weight * grad[12 * i + k];
            }
        }
        // It is 0 outside the box.
        if to_factor != 0.0 {
            let point = point_in_box(points, i, lattice);
            for corner in 0..8u32 {
                let tap = tap(&point, corner, lattice);
                if tap.inside {
                    A::add(
                        &mut to_factors[volume + tap.node],
                        tap.u * tap.v * tap.w * to_factor,
                    );
                }
            }
        }
    }
    rigid_inverse_backward::<A>(&own, transforms, bone, to_transforms);
}
