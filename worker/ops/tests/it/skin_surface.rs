use crate::{numbers, relative_error, values};
use burn::tensor::{Device, Tensor, TensorData};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use yoto_ops::warp::WarpGrid;
use yoto_ops::warp::skin::weights::SkinningWeights;
use yoto_ops::warp::skin_surface::{reference, skin_surface};

const BONES: usize = 4;
/// Largest coordinates of the box.
const BOX: [f32; 3] = [0.5, 0.6, 0.4];
const NODES: [usize; 3] = [5, 7, 4];
const VOXELS: usize = NODES[0] * NODES[1] * NODES[2];
/// Half of the difference between two values of a parameter.
const STEP: f64 = 1e-6;

fn grid() -> WarpGrid {
    WarpGrid {
        min: BOX.map(|side| -side),
        max: BOX,
        nodes: NODES,
        floor: 0.0,
    }
}

/// Posed to canonical: rigid rotations about z, larger for each further bone.
fn transforms() -> Vec<f32> {
    (0..BONES)
        .flat_map(|bone| {
            let (sine, cosine) = (0.45 * bone as f32).sin_cos();
            let shift = 0.1 * bone as f32 - 0.15;
            [
                cosine, -sine, 0.0, shift, sine, cosine, 0.0, -shift, 0.0, 0.0, 1.0, 0.3,
            ]
        })
        .collect()
}

/// Points of a surface with their bones and base weights.
struct Points {
    at: Vec<f32>,
    bones: Vec<f32>,
    weights: Vec<f32>,
    width: usize,
}

impl Points {
    /// Points up to `reach` along each axis. Some of their weights are 0, and some have a bone twice.
    fn new(rng: &mut ChaCha8Rng, count: usize, width: usize, reach: f32) -> Self {
        let at = (0..3 * count).map(|_| rng.random_range(-reach..reach));
        let at = at.collect();
        let bones = (0..width * count).map(|_| rng.random_range(0..BONES) as f32);
        let bones = bones.collect();
        let mut weights: Vec<f32> = (0..width * count)
            .map(|_| rng.random_range(-0.3f32..1.0).max(0.0))
            .collect();
        for own in weights.chunks_exact_mut(width) {
            own[0] += 0.1;
            let sum: f32 = own.iter().sum();
            own.iter_mut().for_each(|weight| *weight /= sum);
        }
        Self {
            at,
            bones,
            weights,
            width,
        }
    }

    fn count(&self) -> usize {
        self.at.len() / 3
    }

    /// Bones and weights on a device.
    fn constants(&self, device: &Device) -> [Tensor<2>; 2] {
        let shape = [self.count(), self.width];
        [&self.bones, &self.weights]
            .map(|numbers| Tensor::from_data(TensorData::new(numbers.clone(), shape), device))
    }
}

type Form =
    fn(Tensor<2>, Tensor<2>, Tensor<2>, Tensor<2>, Tensor<2>, usize, &WarpGrid) -> Tensor<2>;

/// The blended transforms, and the gradients of their product with `towards` to factors, transforms and points. All bones have factors.
fn run(
    form: Form,
    factors: &[f32],
    points: &Points,
    towards: &[f32],
    grid: &WarpGrid,
) -> [Vec<f32>; 4] {
    run_with(form, factors, BONES, points, towards, grid)
}

/// As [`run`], with factors of the first `factored` bones.
fn run_with(
    form: Form,
    factors: &[f32],
    factored: usize,
    points: &Points,
    towards: &[f32],
    grid: &WarpGrid,
) -> [Vec<f32>; 4] {
    let device = Device::flex().autodiff();
    let learned = |numbers: &[f32], columns: usize| {
        let shape = [numbers.len() / columns, columns];
        Tensor::<2>::from_data(TensorData::new(numbers.to_vec(), shape), &device).require_grad()
    };
    let factors = learned(factors, grid.voxels());
    let transforms = learned(&transforms(), 12);
    let at = learned(&points.at, 3);
    let [bones, weights] = points.constants(&device);
    let blended = form(
        factors.clone(),
        transforms.clone(),
        at.clone(),
        bones,
        weights,
        factored,
        grid,
    );
    let towards = TensorData::new(towards.to_vec(), [points.count(), 12]);
    let grads = (blended.clone() * Tensor::from_data(towards, &device))
        .sum()
        .backward();
    let gradient = |tensor: &Tensor<2>| values(tensor.grad(&grads).expect("tracked"));
    [
        values(blended),
        gradient(&factors),
        gradient(&transforms),
        gradient(&at),
    ]
}

fn drawn(rng: &mut ChaCha8Rng, count: usize, low: f32, high: f32) -> Vec<f32> {
    values(numbers(rng, [count], low, high, &Device::flex()))
}

#[test]
fn skinning_of_a_surface_equals_the_reference_inside_and_outside_of_the_box() {
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    for width in [1, 2, 4, 8] {
        // A background after the bones, which no point may read.
        let factors = drawn(&mut rng, (BONES + 1) * VOXELS, 0.2, 3.0);
        // More than a block of points, some of them at the box's border, and one nowhere.
        let mut points = Points::new(&mut rng, 700, width, 0.9);
        points.at[..3].copy_from_slice(&BOX);
        points.at[3..6].copy_from_slice(&BOX.map(|side| -side));
        points.at[6] = BOX[0];
        points.at[10] = -BOX[1];
        points.at[12] = f32::NAN;
        points.at[15] = f32::INFINITY;
        let towards = drawn(&mut rng, 12 * 700, -1.0, 1.0);
        let ours = run(skin_surface, &factors, &points, &towards, &grid());
        let theirs = run(
            reference::skin_surface,
            &factors,
            &points,
            &towards,
            &grid(),
        );
        let parts = ["output", "factors", "transforms", "points"];
        for ((part, ours), theirs) in parts.iter().zip(&ours).zip(&theirs) {
            assert!(ours.iter().chain(theirs).all(|number| number.is_finite()));
            if width == 1 && ["factors", "points"].contains(part) {
                // The only bone of a point moves it, whatever its factor is.
                assert!(ours.iter().all(|gradient| *gradient == 0.0), "{part}");
                assert!(theirs.iter().all(|gradient| gradient.abs() < 1e-5));
                continue;
            }
            let error = relative_error(ours, theirs);
            assert!(error < 1e-5, "{part} with {width} bones: {error:e}");
        }
        let background = &ours[1][BONES * VOXELS..];
        assert!(background.iter().all(|gradient| *gradient == 0.0));
    }
}

#[test]
fn bones_without_factors_have_the_factor_1() {
    let mut rng = ChaCha8Rng::seed_from_u64(12);
    let factored = 2;
    let own = drawn(&mut rng, (factored + 1) * VOXELS, 0.2, 3.0);
    let mut all = own[..factored * VOXELS].to_vec();
    all.resize(BONES * VOXELS, 1.0);
    let points = Points::new(&mut rng, 700, 4, 0.7);
    let towards = drawn(&mut rng, 12 * 700, -1.0, 1.0);
    let expected = run(skin_surface, &all, &points, &towards, &grid());
    for form in [skin_surface, reference::skin_surface] {
        let found = run_with(form, &own, factored, &points, &towards, &grid());
        for part in [0, 2, 3] {
            assert!(
                relative_error(&found[part], &expected[part]) < 1e-5,
                "{part}"
            );
        }
        let (to_factors, background) = found[1].split_at(factored * VOXELS);
        assert!(relative_error(to_factors, &expected[1][..factored * VOXELS]) < 1e-5);
        assert!(background.iter().all(|gradient| *gradient == 0.0));
    }
}

#[test]
fn points_outside_and_points_without_factors_have_their_base_weights() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let (nothing, ones) = (vec![0.0; BONES * VOXELS], vec![1.0; BONES * VOXELS]);
    let random = drawn(&mut rng, BONES * VOXELS, 0.2, 3.0);
    let inside = Points::new(&mut rng, 50, 4, 0.4);
    let mut outside = Points::new(&mut rng, 50, 4, 0.4);
    for at in outside.at.chunks_exact_mut(3) {
        // Less than a cell from the box.
        at[1] = 0.601;
    }
    let towards = drawn(&mut rng, 12 * 50, -1.0, 1.0);
    for (points, factors) in [(&inside, &nothing), (&outside, &random)] {
        for form in [skin_surface, reference::skin_surface] {
            let found = run(form, factors, points, &towards, &grid());
            let expected = run(skin_surface, &ones, points, &towards, &grid());
            assert!(relative_error(&found[0], &expected[0]) < 1e-6);
            assert!(relative_error(&found[2], &expected[2]) < 1e-5);
            for gradients in [&found[1], &found[3]] {
                assert!(gradients.iter().all(|gradient| *gradient == 0.0));
            }
        }
    }
}

/// Σ `towards` Σ wᵢ Gᵢ in double precision, of points inside the box.
fn exact(
    [factors, transforms, at]: &[Vec<f64>; 3],
    points: &Points,
    towards: &[f32],
    grid: &WarpGrid,
) -> f64 {
    let factor = |bone: usize, x: &[f64]| -> f64 {
        let cells: Vec<(usize, f64)> = (0..3)
            .map(|a| {
                let cell = (x[a] - f64::from(grid.min[a])) * f64::from(grid.scale()[a]);
                (cell as usize, cell - cell.floor())
            })
            .collect();
        (0..8usize)
            .map(|corner| {
                let (mut share, mut node) = (1.0, 0);
                for a in (0..3).rev() {
                    let (low, part) = cells[a];
                    let high = corner >> a & 1;
                    share *= if high == 1 { part } else { 1.0 - part };
                    node = node * grid.nodes[a] + low + high;
                }
                share * factors[bone * grid.voxels() + node]
            })
            .sum()
    };
    let mut total = 0.0;
    for (i, x) in at.chunks_exact(3).enumerate() {
        let own: Vec<(usize, f64)> = (i * points.width..(i + 1) * points.width)
            .map(|k| {
                let bone = points.bones[k] as usize;
                (bone, f64::from(points.weights[k]) * factor(bone, x))
            })
            .collect();
        let sum: f64 = own.iter().map(|(_, weight)| weight).sum();
        for (bone, weight) in own {
            let t = &transforms[12 * bone..12 * bone + 12];
            for row in 0..3 {
                let towards = &towards[12 * i + 4 * row..][..4];
                for column in 0..3 {
                    let rotation = t[4 * column + row];
                    let shift = -rotation * t[4 * column + 3];
                    let along =
                        f64::from(towards[column]) * rotation + f64::from(towards[3]) * shift;
                    total += weight / sum * along;
                }
            }
        }
    }
    total
}

#[test]
fn gradients_are_slopes_in_double_precision() {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let grid = WarpGrid {
        nodes: [3, 4, 3],
        ..grid()
    };
    let factors = drawn(&mut rng, BONES * grid.voxels(), 0.2, 3.0);
    let points = Points::new(&mut rng, 40, 3, 0.39);
    let towards = drawn(&mut rng, 12 * 40, -1.0, 1.0);
    let [_, gradients @ ..] = run(skin_surface, &factors, &points, &towards, &grid);
    let doubles = |numbers: &[f32]| numbers.iter().map(|v| f64::from(*v)).collect::<Vec<_>>();
    let mut inputs = [&factors, &transforms(), &points.at].map(|input| doubles(input));
    for (input, gradient) in gradients.iter().enumerate() {
        let slopes: Vec<f32> = (0..gradient.len())
            .map(|k| {
                let mut moved = |by: f64| {
                    let middle = std::mem::replace(&mut inputs[input][k], 0.0);
                    inputs[input][k] = middle + by;
                    let value = exact(&inputs, &points, &towards, &grid);
                    inputs[input][k] = middle;
                    value
                };
                ((moved(STEP) - moved(-STEP)) / (2.0 * STEP)) as f32
            })
            .collect();
        let error = relative_error(gradient, &slopes);
        assert!(error < 1e-5, "input {input}: {error:e}");
    }
}

#[test]
fn the_number_of_threads_changes_no_bit_of_a_gradient() {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let factors = drawn(&mut rng, BONES * VOXELS, 0.2, 3.0);
    let points = Points::new(&mut rng, 3_000, 4, 0.6);
    let towards = drawn(&mut rng, 12 * 3_000, -1.0, 1.0);
    let [one, three] = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let found = pool
            .expect("a pool")
            .install(|| run(skin_surface, &factors, &points, &towards, &grid()));
        found.map(|part| part.into_iter().map(f32::to_bits).collect::<Vec<_>>())
    });
    assert!(one == three);
}

#[test]
fn weights_for_pictures_are_those_of_the_operation() {
    let mut rng = ChaCha8Rng::seed_from_u64(10);
    let factors = drawn(&mut rng, BONES * VOXELS, 0.2, 3.0);
    let points = Points::new(&mut rng, 600, 4, 0.7);
    let Points {
        at,
        bones,
        weights,
        width,
    } = &points;
    let found = SkinningWeights::of_surface(&factors, BONES, at, bones, weights, *width, &grid());
    let towards = vec![1.0; 12 * 600];
    let [expected, ..] = run(skin_surface, &factors, &points, &towards, &grid());
    assert!(found.skin(&transforms()) == expected);
}

#[test]
fn no_points_are_skinned_to_nothing() {
    let device = Device::flex();
    let [at, bones] = [3, 4].map(|columns| Tensor::<2>::zeros([0, columns], &device));
    let factors = Tensor::ones([BONES, VOXELS], &device);
    let transforms = Tensor::ones([BONES, 12], &device);
    let skinned = skin_surface(
        factors,
        transforms,
        at,
        bones.clone(),
        bones,
        BONES,
        &grid(),
    );
    assert_eq!(skinned.dims(), [0, 12]);
}

#[test]
#[should_panic(expected = "bone Some(4.0) of 4")]
fn a_bone_without_a_transform_is_refused() {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let factors = vec![1.0; (BONES + 1) * VOXELS];
    let mut points = Points::new(&mut rng, 5, 2, 0.4);
    points.bones[7] = BONES as f32;
    run(skin_surface, &factors, &points, &[1.0; 60], &grid());
}
