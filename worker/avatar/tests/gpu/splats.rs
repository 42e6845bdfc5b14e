//! The operations of a training of splats: their pictures, forward skinning, and the loss of a picture,
//! each against the form for CPU threads, values and gradients.

use crate::compare::{Numbers, assert_close, values};
use crate::device::on_vulkan;
use burn::tensor::{Device, Tensor};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use yoto_ops::picture_loss::{Target, Weights, picture_loss};
use yoto_ops::splat::{Splats, View, splat};
use yoto_ops::warp::WarpGrid;
use yoto_ops::warp::skin::skin;

/// Seconds an operation may take: a software driver compiles its kernels first.
const LIMIT: u64 = 120;
/// Largest error over the largest magnitude, of f32 sums in another order.
const BOUND: f32 = 2e-5;

/// Splats in host memory, all within half a metre of the body's middle.
struct Drawn {
    transforms: Numbers<2>,
    means: Numbers<2>,
    rotations: Numbers<2>,
    scales: Numbers<2>,
    opacities: Numbers<1>,
    colours: Numbers<2>,
    light: Numbers<2>,
    towards: u64,
}

impl Drawn {
    /// `count` splats, carried by transforms that turn, shear and stretch them.
    fn new(seed: u64, count: usize, scales: [f32; 2], opacities: [f32; 2]) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut draw = |columns, low, high| Numbers::drawn(&mut rng, [count, columns], low, high);
        Self {
            transforms: draw(12, -0.3, 0.3).with(|values| {
                for transform in values.chunks_exact_mut(12) {
                    for diagonal in [0, 5, 10] {
                        transform[diagonal] += 1.0;
                    }
                }
            }),
            means: draw(3, -0.5, 0.5),
            rotations: draw(4, -1.0, 1.3),
            scales: draw(3, scales[0], scales[1]),
            colours: draw(3, 0.1, 0.9),
            opacities: Numbers::drawn(&mut rng, [count], opacities[0], opacities[1]),
            light: Numbers::drawn(&mut rng, [3, 8], -0.3, 0.3),
            towards: seed,
        }
    }

    /// The picture on a device, and the gradients of a sum over it.
    fn run(&self, body_view: &View, device: &Device) -> [Vec<f32>; 8] {
        let device = device.clone().autodiff();
        let splats = Splats {
            transforms: self.transforms.learned_on(&device),
            means: self.means.learned_on(&device),
            rotations: self.rotations.learned_on(&device),
            scales: self.scales.learned_on(&device),
            opacities: self.opacities.learned_on(&device),
            colours: self.colours.learned_on(&device),
            harmonics: None,
            light: self.light.learned_on(&device),
        };
        let picture = splat(splats.clone(), body_view);
        let mut rng = ChaCha8Rng::seed_from_u64(self.towards);
        let towards = Numbers::drawn(&mut rng, picture.dims(), -1.0, 1.0);
        let grads = (picture.clone() * towards.on(&device)).sum().backward();
        let gradient = |tensor: &Tensor<2>| values(tensor.grad(&grads).expect("tracked"));
        [
            values(picture),
            gradient(&splats.transforms),
            gradient(&splats.means),
            gradient(&splats.rotations),
            gradient(&splats.scales),
            values(splats.opacities.grad(&grads).expect("tracked")),
            gradient(&splats.colours),
            gradient(&splats.light),
        ]
    }
}

const PARTS: [&str; 8] = [
    "picture",
    "transforms",
    "means",
    "rotations",
    "scales",
    "opacities",
    "colours",
    "light",
];

/// A camera two metres from the body, turned a little, with a skew.
fn body_view(width: usize, height: usize) -> View {
    let (w, h) = (width as f32, height as f32);
    View {
        width,
        height,
        k: [[1.4 * w, 0.03 * w, 0.48 * w], [0.0, 1.5 * h, 0.53 * h]],
        e: [
            [0.995, 0.0, 0.0998, 0.05],
            [0.0, 1.0, 0.0, -0.02],
            [-0.0998, 0.0, 0.995, 2.0],
        ],
        world: [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
    }
}

fn assert_equals_the_cpu(drawn: &Drawn, body_view: &View, vulkan: &Device, bound: f32) {
    let ours = drawn.run(body_view, vulkan);
    assert_close(&PARTS, &ours, &drawn.run(body_view, &Device::flex()), bound);
}

#[test]
fn pictures_of_splats_of_any_size_and_number_equal_the_cpus() {
    on_vulkan(LIMIT, |vulkan| {
        // Whole tiles, parts of tiles, less than a strip of one.
        for (seed, count, [width, height]) in [
            (1, 1, [32, 48]),
            (2, 40, [37, 29]),
            (3, 300, [66, 50]),
            (4, 700, [19, 3]),
            (5, 20, [2, 1]),
        ] {
            println!("{count} in {width} x {height}");
            let drawn = Drawn::new(seed, count, [-5.0, -3.0], [-6.0, 2.0]);
            assert_equals_the_cpu(&drawn, &body_view(width, height), &vulkan, BOUND);
        }
    });
}

/// A strip of pixels ends on its own where the CPU ends a tile at once: after a splat of which all but
/// nothing is seen. Here that is every strip, behind a few of 400 splats that each cover most of the picture.
#[test]
fn what_hides_behind_many_opaque_splats_is_left_out_unseen() {
    on_vulkan(LIMIT, |vulkan| {
        let drawn = Drawn::new(6, 400, [-1.7, -1.3], [2.0, 8.0]);
        assert_equals_the_cpu(&drawn, &body_view(40, 40), &vulkan, 1e-2);
    });
}

#[test]
fn hidden_splats_and_those_behind_the_camera_or_not_finite_have_no_gradients() {
    on_vulkan(LIMIT, |vulkan| {
        let mut drawn = Drawn::new(7, 70, [-5.0, -3.0], [-1.0, 2.0]);
        drawn.means = drawn.means.with(|values| {
            values[2] = -5.0;
            values[3] = f32::NAN;
            values[6] = f32::INFINITY;
        });
        drawn.scales = drawn.scales.with(|values| values[9] = f32::NAN);
        drawn.opacities = drawn.opacities.with(|values| {
            values[4] = -20.0;
            values[5] = f32::NAN;
        });
        // No turn at all.
        drawn.rotations = drawn.rotations.with(|values| values[24..28].fill(0.0));
        let body_view = body_view(37, 29);
        let ours = drawn.run(&body_view, &vulkan);
        for (part, values) in PARTS.iter().zip(&ours) {
            assert!(values.iter().all(|value| value.is_finite()), "{part}");
        }
        for (part, width) in [(1, 12), (2, 3), (4, 3), (5, 1), (6, 3)] {
            let hidden = &ours[part][..6 * width];
            assert!(hidden.iter().all(|value| *value == 0.0), "{}", PARTS[part]);
        }
        assert_close(
            &PARTS,
            &ours,
            &drawn.run(&body_view, &Device::flex()),
            BOUND,
        );
    });
}

#[test]
fn pictures_without_splats_pixels_or_anybody_in_sight_are_black() {
    on_vulkan(LIMIT, |vulkan| {
        let nobody = Drawn::new(8, 0, [-5.0, -3.0], [-1.0, 2.0]);
        let away = Drawn::new(9, 30, [-5.0, -3.0], [-1.0, 2.0]);
        let mut behind = body_view(20, 20);
        behind.e[2][3] = -4.0;
        let mut beside = body_view(20, 20);
        beside.k[0][2] = 9_000.0;
        for (drawn, body_view) in [
            (&nobody, body_view(20, 20)),
            (&away, behind),
            (&away, beside),
            (&away, body_view(0, 7)),
        ] {
            let found = drawn.run(&body_view, &vulkan);
            assert_eq!(found[0].len(), 4 * body_view.width * body_view.height);
            for (part, values) in PARTS.iter().zip(&found) {
                assert!(values.iter().all(|value| *value == 0.0), "{part}");
            }
        }
    });
}

#[test]
fn forward_skinning_equals_the_cpus_inside_and_outside_of_the_box() {
    on_vulkan(LIMIT, |vulkan| {
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let (bones, voxels, n) = (3, 7 * 6 * 9, 2_300);
        for floor in [0.0, 0.1] {
            let grid = WarpGrid {
                min: [-1.0, -0.5, -0.8],
                max: [1.0, 1.5, 0.6],
                nodes: [7, 6, 9],
                floor,
            };
            // A background after the bones, which no point may read, and a bone without weights.
            let weights = Numbers::drawn(&mut rng, [bones + 1, voxels], 0.0, 0.4)
                .with(|values| values[voxels..2 * voxels].fill(0.0));
            // Rigid ones, turned about z.
            let transforms = Numbers::drawn(&mut rng, [bones, 12], -0.8, 0.8).with(|values| {
                for (transform, angle) in values.chunks_exact_mut(12).zip([0.0f32, 0.7, -1.2]) {
                    let (sin, cos) = angle.sin_cos();
                    transform[..3].copy_from_slice(&[cos, -sin, 0.0]);
                    transform[4..7].copy_from_slice(&[sin, cos, 0.0]);
                    transform[8..11].copy_from_slice(&[0.0, 0.0, 1.0]);
                }
            });
            let points = Numbers::drawn(&mut rng, [n, 3], -1.6, 1.6);
            let towards = Numbers::drawn(&mut rng, [n, 12], -1.0, 1.0)
                .with(|values| values[12 * 2_000..].fill(0.0));
            let run = |device: &Device| {
                let device = device.clone().autodiff();
                let weights = weights.learned_on(&device);
                let transforms = transforms.learned_on(&device);
                let points = points.learned_on(&device);
                let output = skin(weights.clone(), transforms.clone(), points.clone(), &grid);
                let grads = (output.clone() * towards.on(&device)).sum().backward();
                let gradient = |tensor: &Tensor<2>| values(tensor.grad(&grads).expect("tracked"));
                [
                    values(output),
                    gradient(&weights),
                    gradient(&transforms),
                    gradient(&points),
                ]
            };
            let ours = run(&vulkan);
            let parts = ["output", "weights", "transforms", "points"];
            assert_close(&parts, &ours, &run(&Device::flex()), BOUND);
        }
        let none = Tensor::<2>::zeros([0, 3], &vulkan);
        let weights = Tensor::ones([1, 27], &vulkan);
        let grid = WarpGrid {
            min: [0.0; 3],
            max: [1.0; 3],
            nodes: [3; 3],
            floor: 0.0,
        };
        let skinned = skin(weights, Tensor::ones([1, 12], &vulkan), none, &grid);
        assert_eq!(skinned.dims(), [0, 12]);
        assert!(values(skinned).is_empty());
    });
}

#[test]
fn the_loss_of_a_picture_equals_the_cpus() {
    on_vulkan(LIMIT, |vulkan| {
        let mut rng = ChaCha8Rng::seed_from_u64(12);
        let (width, height) = (43, 31);
        let picture = Numbers::drawn(&mut rng, [width * height, 4], 0.0, 1.0);
        let mut bytes = |count: usize| (0..count).map(|_| rng.random::<u8>()).collect();
        let mut target = Target {
            width,
            height,
            rgb: bytes(3 * width * height),
            mask: bytes(width * height),
            region: [0; 4],
            weights: Weights {
                absolute: 0.8,
                ssim: 0.2,
                mask: 0.1,
            },
        };
        // All of it, a part, less than a window, a pixel in the corner.
        for region in [
            [0, 0, 43, 31],
            [5, 3, 40, 20],
            [7, 7, 10, 12],
            [42, 30, 43, 31],
        ] {
            target.region = region;
            let run = |device: &Device| {
                let picture = picture.learned_on(&device.clone().autodiff());
                let terms = picture_loss(picture.clone(), &target);
                let grads = (terms.clone().narrow(0, 0, 1) * 3.0).backward();
                [
                    values(terms),
                    values(picture.grad(&grads).expect("tracked")),
                ]
            };
            let ours = run(&vulkan);
            assert_close(&["terms", "picture"], &ours, &run(&Device::flex()), BOUND);
        }
    });
}
