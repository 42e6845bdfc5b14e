//! Times of the warp, compositing, the motion decoder's layers and Adam on this machine, and of the
//! same operations in Burn's own tensor operations, at the sizes of a step of the tier `fast`. Prints the
//! shortest processor time of many alternating runs on one thread, so that the load of other
//! programs has little effect.
//!
//! `cargo bench --workspace --bench volume --profile dev`, the profile of `cargo run`.

mod timing;

use burn::tensor::{Device, Tensor, TensorData};
use timing::{heading, line, many, noise, on_one_thread, shortest};
use yoto_ops::adam::{self, AdamRates};
use yoto_ops::composite::{self, RaySamples};
use yoto_ops::deconv;
use yoto_ops::warp::{self, WarpGrid};

/// Number of runs of each form.
const RUNS: usize = 15;
/// Rays per step, and evaluated samples per ray.
const RAYS: usize = 8 * 12 * 12;
const SAMPLES: usize = 23;
/// Bones, and voxels per side of the motion volume.
const BONES: usize = 24;
const SIDE: usize = 24;
/// Number of parameters that Adam updates.
const PARAMETERS: usize = 1 << 20;

/// Weights that fall off around a joint like learned ones: most of the volume is close to 0.
fn weights() -> Vec<f32> {
    let mut weights = Vec::with_capacity(BONES * SIDE.pow(3));
    for bone in 0..BONES {
        let centre: [f32; 3] = std::array::from_fn(|a| noise(3 * bone + a));
        for voxel in 0..SIDE.pow(3) {
            let at = [voxel % SIDE, voxel / SIDE % SIDE, voxel / SIDE / SIDE];
            let far: f32 = (0..3)
                .map(|a| (at[a] as f32 / SIDE as f32 - centre[a]).powi(2))
                .sum();
            weights.push((-60.0 * far).exp());
        }
    }
    weights
}

fn warps(device: &Device) {
    let grid = WarpGrid {
        min: [0.0; 3],
        max: [1.0; 3],
        nodes: [SIDE; 3],
        floor: warp::MIN_WEIGHT_SUM,
    };
    let n = RAYS * SAMPLES;
    let weights = TensorData::new(weights(), [BONES, SIDE.pow(3)]);
    let weights = Tensor::<2>::from_data(weights, device).require_grad();
    let mut transforms = vec![0f32; BONES * 12];
    for (i, bone) in transforms.chunks_exact_mut(12).enumerate() {
        (bone[0], bone[5], bone[10]) = (1.0, 1.0, 1.0);
        bone[3] = 0.05 * noise(i);
    }
    let transforms =
        Tensor::<2>::from_data(TensorData::new(transforms, [BONES, 12]), device).require_grad();
    let points = Tensor::<2>::from_data(TensorData::new(many(3 * n, 1.0), [n, 3]), device);
    let ours = || warp::warp(weights.clone(), transforms.clone(), points.clone(), &grid);
    let burns =
        || warp::reference::warp(weights.clone(), transforms.clone(), points.clone(), &grid);
    line(
        "warp, forward",
        shortest(RUNS, [&mut || drop(ours()), &mut || drop(burns())]),
    );
    line(
        "warp, forward and backward",
        shortest(
            RUNS,
            [&mut || drop(ours().sum().backward()), &mut || {
                drop(burns().sum().backward())
            }],
        ),
    );
}

fn composites(device: &Device) {
    let n = RAYS * SAMPLES;
    let samples = RaySamples {
        starts: (0..=RAYS).map(|ray| ray * SAMPLES).collect(),
        steps: vec![0.02; n].into(),
        depths: (0..n).map(|i| 2.0 + 0.02 * (i % SAMPLES) as f32).collect(),
        min_transmittance: 1e-3,
        subsampling: None,
    };
    let flat = |scale| Tensor::<1>::from_data(TensorData::new(many(n, scale), [n]), device);
    let rgb = Tensor::<2>::from_data(TensorData::new(many(3 * n, 1.0), [n, 3]), device);
    let (rgb, density) = (rgb.require_grad(), flat(30.0).require_grad());
    let likelihood = flat(1.0).require_grad();
    let ours = || composite::composite(rgb.clone(), density.clone(), likelihood.clone(), &samples);
    let burns = || {
        let (rgb, density, likelihood) = (rgb.clone(), density.clone(), likelihood.clone());
        composite::reference::composite(rgb, density, likelihood, &samples)
    };
    line(
        "compositing, forward",
        shortest(RUNS, [&mut || drop(ours()), &mut || drop(burns())]),
    );
    line(
        "compositing, both ways",
        shortest(
            RUNS,
            [&mut || drop(ours().sum().backward()), &mut || {
                drop(burns().sum().backward())
            }],
        ),
    );
}

/// All five layers of the paper's motion decoder.
fn deconvs(device: &Device) {
    let widths = [1024, 512, 512, 256, 256, BONES + 1];
    let layers: Vec<(Tensor<4>, Tensor<5>)> = widths
        .windows(2)
        .enumerate()
        .map(|(layer, width)| {
            let (side, kernel) = (1usize << layer, [width[0], width[1], 4, 4, 4]);
            let volume = TensorData::new(
                many(width[0] * side.pow(3), 1.0),
                [width[0], side, side, side],
            );
            let kernels = TensorData::new(many(kernel.iter().product(), 1.0), kernel);
            (
                Tensor::<4>::from_data(volume, device).require_grad(),
                Tensor::<5>::from_data(kernels, device).require_grad(),
            )
        })
        .collect();
    let run = |form: fn(Tensor<4>, Tensor<5>) -> Tensor<4>, back: bool| {
        for (volume, kernels) in &layers {
            let output = form(volume.clone(), kernels.clone());
            if back {
                drop(output.sum().backward());
            }
        }
    };
    for (name, back) in [("decoder, forward", false), ("decoder, both ways", true)] {
        line(
            name,
            shortest(
                RUNS,
                [&mut || run(deconv::conv_transpose, back), &mut || {
                    run(deconv::reference::conv_transpose, back)
                }],
            ),
        );
    }
}

fn adams(device: &Device) {
    let rates = AdamRates::new(1e-2, 0.9, 0.999, 1e-8, 3);
    let tensor =
        || Tensor::<1>::from_data(TensorData::new(many(PARAMETERS, 1.0), [PARAMETERS]), device);
    let grad = tensor();
    // Each has its own tensors, and passes them on at each update as the optimiser does.
    let mut a = Some((tensor(), tensor(), tensor()));
    let mut b = Some((tensor(), tensor(), tensor()));
    let mut ours = || {
        a = a
            .take()
            .map(|(p, m, v)| adam::update(p, grad.clone(), m, v, rates));
    };
    let mut burns = || {
        b = b
            .take()
            .map(|(p, m, v)| adam::reference::update(p, grad.clone(), m, v, rates));
    };
    line(
        "Adam, a million numbers",
        shortest(RUNS, [&mut ours, &mut burns]),
    );
}

fn measure() {
    println!(
        "{} samples, {BONES} bones, volume of {SIDE}³",
        RAYS * SAMPLES
    );
    heading();
    let device = Device::flex();
    warps(&device.clone().autodiff());
    composites(&device.clone().autodiff());
    deconvs(&device.clone().autodiff());
    adams(&device);
}

fn main() -> Result<(), rayon::ThreadPoolBuildError> {
    on_one_thread(measure)
}
