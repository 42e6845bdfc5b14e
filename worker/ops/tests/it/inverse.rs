use crate::{relative_error, values};
use burn::tensor::{Device, Tensor, TensorData};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use yoto_ops::warp::inverse::{reference, unpose};
use yoto_ops::warp::{self, WarpGrid};

const BONES: usize = 3;
const NODES: [usize; 3] = [9, 11, 8];

fn grid() -> WarpGrid {
    WarpGrid {
        min: [-0.5, -0.6, -0.4],
        max: [0.5, 0.6, 0.4],
        nodes: NODES,
        floor: 0.0,
    }
}

/// Weights that change slowly along y, as along an arm, and a background.
fn weights() -> Vec<f32> {
    let voxels: usize = NODES.iter().product();
    let mut weights = vec![0f32; (BONES + 1) * voxels];
    for voxel in 0..voxels {
        let y = (voxel / NODES[0] % NODES[1]) as f32 / (NODES[1] - 1) as f32;
        for bone in 0..BONES {
            let centre = bone as f32 / (BONES - 1) as f32;
            weights[bone * voxels + voxel] = 0.4 * (-6.0 * (y - centre).powi(2)).exp();
        }
    }
    weights
}

/// Posed to canonical: rigid rotations about z, larger for each further bone.
fn transforms() -> Vec<f32> {
    (0..BONES)
        .flat_map(|bone| {
            let (sine, cosine) = (0.45 * bone as f32).sin_cos();
            let shift = 0.02 * bone as f32;
            [
                cosine, -sine, 0.0, shift, sine, cosine, 0.0, -shift, 0.0, 0.0, 1.0, 0.01,
            ]
        })
        .collect()
}

/// Forward skinning of a canonical point, written out.
fn skinned(weights: &[f32], transforms: &[f32], c: [f32; 3]) -> [f64; 3] {
    let (grid, voxels) = (grid(), NODES.iter().product::<usize>());
    let offsets: Vec<(usize, f64)> = (0..3)
        .map(|a| {
            let cell = f64::from((c[a] - grid.min[a]) * grid.scale()[a]);
            let low = (cell as usize).min(NODES[a] - 2);
            (low, cell - low as f64)
        })
        .collect();
    let weight = |bone: usize| -> f64 {
        (0..8usize)
            .map(|corner| {
                let (mut share, mut index) = (1.0, 0);
                for a in (0..3).rev() {
                    let high = corner >> a & 1;
                    share *= if high == 1 {
                        offsets[a].1
                    } else {
                        1.0 - offsets[a].1
                    };
                    index = index * NODES[a] + offsets[a].0 + high;
                }
                share * f64::from(weights[bone * voxels + index])
            })
            .sum()
    };
    let sum: f64 = (0..BONES).map(weight).sum();
    let mut x = [0f64; 3];
    for bone in 0..BONES {
        let t = &transforms[12 * bone..12 * bone + 12];
        for (a, x) in x.iter_mut().enumerate() {
            let back: f64 = (0..3)
                .map(|r| f64::from(t[4 * r + a]) * f64::from(c[r] - t[4 * r + 3]))
                .sum();
            *x += weight(bone) / sum * back;
        }
    }
    x
}

/// Points that forward skinning reaches, and the canonical ones that it takes there.
fn points(count: usize) -> (Vec<f32>, Vec<[f32; 3]>) {
    let mut rng = ChaCha8Rng::seed_from_u64(31);
    let canonical: Vec<[f32; 3]> = (0..count)
        .map(|_| {
            [
                rng.random_range(-0.12..0.12),
                rng.random_range(-0.5..0.5),
                rng.random_range(-0.12..0.12),
            ]
        })
        .collect();
    let (weights, transforms) = (weights(), transforms());
    let posed = canonical
        .iter()
        .flat_map(|c| skinned(&weights, &transforms, *c))
        .map(|v| v as f32);
    (posed.collect(), canonical)
}

fn tensors(device: &Device, count: usize) -> [Tensor<2>; 3] {
    let (points, _) = points(count);
    let voxels: usize = NODES.iter().product();
    let tensor = |values: Vec<f32>, shape: [usize; 2]| {
        Tensor::<2>::from_data(TensorData::new(values, shape), device)
    };
    [
        tensor(weights(), [BONES + 1, voxels]),
        tensor(transforms(), [BONES, 12]),
        tensor(points, [count, 3]),
    ]
}

#[test]
fn the_found_points_are_skinned_to_the_given_ones() {
    let device = Device::flex();
    let count = 600;
    let [weights, transforms, points] = tensors(&device, count);
    let blend = warp::warp(weights.clone(), transforms.clone(), points.clone(), &grid());
    let blend = blend.slice([0..count, 0..3]);
    let found = unpose(
        weights,
        transforms,
        points,
        blend.clone(),
        blend.clone(),
        &grid(),
        12,
    );
    let (_, canonical) = self::points(count);
    let far = |points: Tensor<2>| -> f32 {
        let points = values(points);
        let apart = points.iter().zip(canonical.as_flattened());
        apart.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    };
    let (blend, found) = (far(blend), far(found));
    assert!(found < 1e-4, "{found} m off");
    assert!(blend > 0.02, "the blend is only {blend} m off: too easy");
}

#[test]
fn points_and_gradients_equal_the_reference() {
    let device = Device::flex().autodiff();
    let count = 300;
    let [weights, transforms, points] = tensors(&device, count);
    let (weights, transforms) = (weights.require_grad(), transforms.require_grad());
    let mut rng = ChaCha8Rng::seed_from_u64(32);
    let towards = crate::numbers(&mut rng, [count, 3], -1.0, 1.0, &device);
    // A tenth of the points is beyond the box, where no search succeeds.
    let outside: Vec<f32> = (0..3 * count)
        .map(|i| if i / 3 % 10 == 0 { 3.0 } else { 0.0 })
        .collect();
    let shift = Tensor::<2>::from_data(TensorData::new(outside, [count, 3]), &device);
    let points = points + shift;
    let fallback = (points.clone() * 0.5).require_grad();

    type Form =
        fn(Tensor<2>, Tensor<2>, Tensor<2>, Tensor<2>, Tensor<2>, &WarpGrid, usize) -> Tensor<2>;
    let run = |form: Form| {
        let near = warp::warp(weights.clone(), transforms.clone(), points.clone(), &grid());
        let near = near.slice([0..count, 0..3]).detach();
        let found = form(
            weights.clone(),
            transforms.clone(),
            points.clone(),
            near,
            fallback.clone(),
            &grid(),
            // Enough that the reference, whose gradients run through all steps, converges.
            25,
        );
        let grads = (found.clone() * towards.clone()).sum().backward();
        [
            values(found),
            values(weights.grad(&grads).expect("tracked")),
            values(transforms.grad(&grads).expect("tracked")),
            values(fallback.grad(&grads).expect("tracked")),
        ]
    };
    let (ours, reference) = (run(unpose), run(reference::unpose));
    for (part, (a, b)) in ["points", "weights", "transforms", "fallback"]
        .iter()
        .zip(ours.iter().zip(&reference))
    {
        let error = relative_error(a, b);
        assert!(error < 1e-3, "{part}: {error:e}");
    }
}
