//! Inverse skinning in Burn's own tensor operations.

use super::{MAX_LAST_STEP, MIN_DETERMINANT, MIN_SUM, WarpGrid};
use crate::cofactors::inverse;
use burn::tensor::{Bool, Int, Tensor};

/// See [`super::unpose`].
pub fn unpose(
    weights: Tensor<2>,
    transforms: Tensor<2>,
    points: Tensor<2>,
    near: Tensor<2>,
    fallback: Tensor<2>,
    grid: &WarpGrid,
    steps: usize,
) -> Tensor<2> {
    let [n, _] = points.dims();
    if n == 0 {
        return fallback;
    }
    let body = PosedBody::new(weights, transforms, grid);
    let still = body.detached();
    let device = points.device();
    let mut at = near.detach();
    let mut last = Tensor::<1>::full([n], f32::INFINITY, &device);
    let mut lost = last.clone().is_nan();
    for _ in 0..steps {
        let blend = still.blend(at.clone());
        let (inverse_rotation, folded) = sound_inverse(blend.rotation, None);
        lost = lost.bool_or(folded).bool_or(blend.empty);
        let moved = (points.clone() - blend.shift).reshape([n, 3, 1]);
        let next = inverse_rotation.matmul(moved).reshape([n, 3]);
        last = (next.clone() - at).abs().max_dim(1).reshape([n]);
        at = next;
    }
    let lost = lost.bool_or(last.lower_scalar(MAX_LAST_STEP).bool_not());
    let lost = lost.reshape([n, 1]).repeat_dim(1, 3);
    // Lost points can be anywhere, even not finite.
    let at = at.mask_where(lost.clone(), fallback.clone().detach());
    // The value of the point stays; its differential is −J⁻¹ times that of forward skinning there.
    let jacobian = still.jacobian(at.clone());
    let plain = still.blend(at.clone()).rotation;
    let (back, _) = sound_inverse(jacobian, Some(plain));
    let skinned = body.skinned(at.clone());
    let change = (skinned.clone() - skinned.detach()).reshape([n, 3, 1]);
    let found = at - back.matmul(change).reshape([n, 3]);
    found.mask_where(lost, fallback)
}

/// The inverses of `m` `[N, 3, 3]`, and where its determinant is less than [`MIN_DETERMINANT`]. There, the inverse
/// is that of `instead`, or the identity where that has none either.
fn sound_inverse(m: Tensor<3>, instead: Option<Tensor<3>>) -> (Tensor<3>, Tensor<1, Bool>) {
    let [n, _, _] = m.dims();
    let (_, volume) = inverse(m.clone());
    let folded = volume
        .reshape([n])
        .greater_equal_scalar(MIN_DETERMINANT)
        .bool_not();
    let mask = folded
        .clone()
        .reshape([n, 1, 1])
        .repeat_dim(1, 3)
        .repeat_dim(2, 3);
    let other = match instead {
        Some(other) => sound_inverse(other, None).0,
        None => Tensor::<2>::eye(3, &m.device())
            .unsqueeze::<3>()
            .repeat_dim(0, n),
    };
    let (inverse, _) = inverse(m);
    (inverse.mask_where(mask, other), folded)
}

/// A posed body: bones from canonical to posed.
pub(in crate::warp) struct PosedBody<'a> {
    weights: Tensor<2>,
    /// `[K, 9]`.
    rotations: Tensor<2>,
    /// `[K, 3]`.
    shifts: Tensor<2>,
    grid: &'a WarpGrid,
}

/// Forward skinning at points.
pub(in crate::warp) struct Blend {
    /// `[N, 3, 3]`.
    pub rotation: Tensor<3>,
    /// `[N, 3]`.
    pub shift: Tensor<2>,
    /// `[N]`: no bone has a weight.
    pub empty: Tensor<1, Bool>,
}

impl<'a> PosedBody<'a> {
    pub(crate) fn new(weights: Tensor<2>, transforms: Tensor<2>, grid: &'a WarpGrid) -> Self {
        let [bones, _] = transforms.dims();
        let transforms = transforms.reshape([bones, 3, 4]);
        // Rᵀ and −Rᵀ t.
        let rotations = transforms.clone().slice([0..bones, 0..3, 0..3]);
        let rotations = rotations.swap_dims(1, 2);
        let shifts = transforms.slice([0..bones, 0..3, 3..4]);
        Self {
            weights: weights.narrow(0, 0, bones),
            shifts: rotations.clone().matmul(shifts).neg().reshape([bones, 3]),
            rotations: rotations.reshape([bones, 9]),
            grid,
        }
    }

    fn detached(&self) -> Self {
        Self {
            weights: self.weights.clone().detach(),
            rotations: self.rotations.clone().detach(),
            shifts: self.shifts.clone().detach(),
            grid: self.grid,
        }
    }

    /// Forward skinning at `at` `[N, 3]`.
    pub(crate) fn blend(&self, at: Tensor<2>) -> Blend {
        let [n, _] = at.dims();
        let [sampled, ..] = self.sample(at);
        let sum = sampled.clone().sum_dim(1);
        let weights = sampled / sum.clone().clamp_min(MIN_SUM);
        Blend {
            rotation: weights
                .clone()
                .matmul(self.rotations.clone())
                .reshape([n, 3, 3]),
            shift: weights.matmul(self.shifts.clone()),
            empty: sum.reshape([n]).lower_equal_scalar(MIN_SUM),
        }
    }

    /// Σ wᵢ Gᵢ c at canonical points c `[N, 3]`.
    fn skinned(&self, at: Tensor<2>) -> Tensor<2> {
        let [n, _] = at.dims();
        let blend = self.blend(at.clone());
        blend.rotation.matmul(at.reshape([n, 3, 1])).reshape([n, 3]) + blend.shift
    }

    /// Its derivative to the points, `[N, 3, 3]`.
    fn jacobian(&self, at: Tensor<2>) -> Tensor<3> {
        let [n, _] = at.dims();
        let [bones, _] = self.rotations.dims();
        let blend = self.blend(at.clone());
        let posed = self.skinned(at.clone());
        let [sampled, x, y, z] = self.sample(at.clone());
        let sum = sampled.sum_dim(1).clamp_min(MIN_SUM).reshape([n, 1, 1]);
        // [3, K 3]: column i 3 + r is row r of bone i.
        let rotations = self.rotations.clone().reshape([bones * 3, 3]).transpose();
        let there =
            at.matmul(rotations).reshape([n, bones, 3]) + self.shifts.clone().unsqueeze::<3>();
        let apart = there - posed.reshape([n, 1, 3]);
        let slopes: Tensor<3> = Tensor::stack(vec![x, y, z], 2);
        blend.rotation + apart.swap_dims(1, 2).matmul(slopes) / sum
    }

    /// Weights `[N, K]` at canonical points `[N, 3]`, and their derivatives along x, y, z, 1/m.
    fn sample(&self, at: Tensor<2>) -> [Tensor<2>; 4] {
        let ([n, _], [bones, _]) = (at.dims(), self.rotations.dims());
        let device = at.device();
        let row = |numbers: [f32; 3]| Tensor::<1>::from_floats(numbers, &device).unsqueeze::<2>();
        let scale = self.grid.scale();
        let cell = (at - row(self.grid.min)) * row(scale);
        let low = cell.clone().floor();
        let part = cell - low.clone();
        let [across, down, _] = self.grid.nodes;
        let strides = [1, across, across * down];
        let mut sampled: [Tensor<2>; 4] =
            std::array::from_fn(|_| Tensor::zeros([bones, n], &device));
        for corner in 0..8usize {
            let mut inside = Tensor::<2>::ones([1, n], &device);
            let mut index = Tensor::<2>::zeros([1, n], &device);
            let mut weights = Vec::with_capacity(3);
            for (a, stride) in strides.into_iter().enumerate() {
                let column = |t: &Tensor<2>| t.clone().slice([0..n, a..a + 1]).reshape([1, n]);
                let high = corner >> a & 1 == 1;
                let last = (self.grid.nodes[a] - 1) as f32;
                let node = column(&low).add_scalar(if high { 1.0 } else { 0.0 });
                inside = inside
                    * node.clone().greater_equal_scalar(0.0).float()
                    * node.clone().lower_equal_scalar(last).float();
                let part = column(&part);
                weights.push(if high { part } else { part.neg() + 1.0 });
                index = index + node.clamp(0.0, last) * stride as f32;
            }
            let index: Tensor<2, Int> = index.int().repeat_dim(0, bones);
            let value = self.weights.clone().gather(1, index) * inside;
            for (along, sampled) in sampled.iter_mut().enumerate() {
                let mut share = value.clone();
                for (a, part) in weights.iter().enumerate() {
                    share = if a + 1 == along {
                        let sign = if corner >> a & 1 == 1 { 1.0 } else { -1.0 };
                        share * (sign * scale[a])
                    } else {
                        share * part.clone()
                    };
                }
                *sampled = sampled.clone() + share;
            }
        }
        sampled.map(Tensor::transpose)
    }
}
