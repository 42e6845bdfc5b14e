//! Forward skinning of a surface against the form for CPU threads, values and gradients.

use crate::compare::{Numbers, assert_close, values};
use crate::device::on_vulkan;
use burn::tensor::{Device, Tensor};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use yoto_ops::warp::WarpGrid;
use yoto_ops::warp::skin_surface::skin_surface;

/// Seconds the test may take: a software driver compiles its kernels first.
const LIMIT: u64 = 120;
/// Largest error over the largest magnitude, of f32 sums in another order.
const BOUND: f32 = 2e-5;

#[test]
fn skinning_of_a_surface_equals_the_cpus_inside_and_outside_of_the_box() {
    on_vulkan(LIMIT, |vulkan| {
        let mut rng = ChaCha8Rng::seed_from_u64(13);
        let (count, voxels, n) = (3, 7 * 6 * 9, 2_300);
        let grid = WarpGrid {
            min: [-1.0, -0.5, -0.8],
            max: [1.0, 1.5, 0.6],
            nodes: [7, 6, 9],
            floor: 0.0,
        };
        for width in [1, 4, 8] {
            // A background after the bones, which no point may read.
            let factors = Numbers::drawn(&mut rng, [count + 1, voxels], 0.2, 3.0);
            // Rigid ones, turned about z.
            let transforms = Numbers::drawn(&mut rng, [count, 12], -0.8, 0.8).with(|values| {
                for (transform, angle) in values.chunks_exact_mut(12).zip([0.0f32, 0.7, -1.2]) {
                    let (sin, cos) = angle.sin_cos();
                    transform[..3].copy_from_slice(&[cos, -sin, 0.0]);
                    transform[4..7].copy_from_slice(&[sin, cos, 0.0]);
                    transform[8..11].copy_from_slice(&[0.0, 0.0, 1.0]);
                }
            });
            // Two of them at the corners of the box.
            let points = Numbers::drawn(&mut rng, [n, 3], -1.6, 1.6).with(|values| {
                values[..3].copy_from_slice(&grid.min);
                values[3..6].copy_from_slice(&grid.max);
            });
            let bones = Numbers::drawn(&mut rng, [n, width], 0.0, count as f32)
                .with(|values| values.iter_mut().for_each(|bone| *bone = bone.floor()));
            // Some of them are 0.
            let weights = Numbers::drawn(&mut rng, [n, width], -0.3, 1.0).with(|values| {
                for own in values.chunks_exact_mut(width) {
                    own.iter_mut().for_each(|weight| *weight = weight.max(0.0));
                    own[0] += 0.1;
                    let sum: f32 = own.iter().sum();
                    own.iter_mut().for_each(|weight| *weight /= sum);
                }
            });
            let towards = Numbers::drawn(&mut rng, [n, 12], -1.0, 1.0)
                .with(|values| values[12 * 2_000..].fill(0.0));
            // The other bones have the factor 1.
            let factored = count - 1;
            let run = |device: &Device| {
                let device = device.clone().autodiff();
                let factors = factors.learned_on(&device);
                let transforms = transforms.learned_on(&device);
                let points = points.learned_on(&device);
                let output = skin_surface(
                    factors.clone(),
                    transforms.clone(),
                    points.clone(),
                    bones.on(&device),
                    weights.on(&device),
                    factored,
                    &grid,
                );
                let grads = (output.clone() * towards.on(&device)).sum().backward();
                let gradient = |tensor: &Tensor<2>| values(tensor.grad(&grads).expect("tracked"));
                [
                    values(output),
                    gradient(&transforms),
                    gradient(&factors),
                    gradient(&points),
                ]
            };
            let (ours, theirs) = (run(&vulkan), run(&Device::flex()));
            let parts = ["output", "transforms", "factors", "points"];
            // The only bone of a point moves it, whatever its factor is.
            let learned = if width == 1 { 2 } else { 4 };
            println!("{width} bones per point");
            assert_close(
                &parts[..learned],
                &ours[..learned],
                &theirs[..learned],
                BOUND,
            );
            for gradients in &ours[learned..] {
                assert!(gradients.iter().all(|gradient| gradient.abs() < 1e-4));
            }
        }
    });
}

#[test]
fn a_surface_without_points_is_skinned_to_nothing() {
    on_vulkan(LIMIT, |vulkan| {
        let grid = WarpGrid {
            min: [0.0; 3],
            max: [1.0; 3],
            nodes: [3; 3],
            floor: 0.0,
        };
        let [points, bones] = [3, 4].map(|columns| Tensor::<2>::zeros([0, columns], &vulkan));
        let factors = Tensor::ones([1, 27], &vulkan);
        let transforms = Tensor::ones([1, 12], &vulkan);
        let skinned = skin_surface(factors, transforms, points, bones.clone(), bones, 1, &grid);
        assert_eq!(skinned.dims(), [0, 12]);
        assert!(values(skinned).is_empty());
    });
}
