//! How long warp, compositing and Adam take on this machine beside the same in Burn's own tensor
//! operations, at the sizes of a step of the tier `fast`. Prints the shortest processor time of
//! many alternating runs on one thread, so that other programs' load hardly shows.
//!
//! `cargo bench --workspace --bench volume --profile dev`: the profile that programs run with.

use burn::tensor::{Device, Tensor, TensorData};
use cpu_time::ThreadTime;
use std::time::Duration;
use yoto_avatar::ops::adam::{self, AdamRates};
use yoto_avatar::ops::composite::{self, RaySamples};
use yoto_avatar::ops::warp::{self, WarpGrid};

/// Runs of each form.
const RUNS: usize = 15;
/// Rays of a step, and live samples of each.
const RAYS: usize = 8 * 12 * 12;
const SAMPLES: usize = 23;
/// Bones and voxels a side of the motion volume.
const BONES: usize = 24;
const SIDE: usize = 24;
/// Numbers that Adam updates.
const PARAMETERS: usize = 1 << 20;

fn noise(i: usize) -> f32 {
    let hash = (i as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    (hash ^ hash >> 29).wrapping_mul(0xBF58_476D_1CE4_E5B9) as u32 as f32 / u32::MAX as f32
}

fn many(count: usize, scale: f32) -> Vec<f32> {
    (0..count).map(|i| scale * noise(i)).collect()
}

/// Shortest milliseconds of both works, taken in turn.
fn shortest(mut works: [&mut dyn FnMut(); 2]) -> [f64; 2] {
    let mut best = [Duration::MAX; 2];
    for _ in 0..RUNS {
        for (work, best) in works.iter_mut().zip(&mut best) {
            let start = ThreadTime::now();
            work();
            *best = (*best).min(start.elapsed());
        }
    }
    best.map(|time| 1e3 * time.as_secs_f64())
}

fn line(name: &str, [ours, burns]: [f64; 2]) {
    println!("{name:<28} {ours:>8.2} {burns:>10.2} {:>7.1}", burns / ours);
}

/// Weights that fall off around a joint, as learned ones do: most of the volume is next to 0.
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
        resolution: SIDE,
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
        shortest([&mut || drop(ours()), &mut || drop(burns())]),
    );
    line(
        "warp, forward and backward",
        shortest([&mut || drop(ours().sum().backward()), &mut || {
            drop(burns().sum().backward())
        }]),
    );
}

fn composites(device: &Device) {
    let n = RAYS * SAMPLES;
    let samples = RaySamples {
        starts: (0..=RAYS).map(|ray| ray * SAMPLES).collect(),
        steps: vec![0.02; n].into(),
        depths: (0..n).map(|i| 2.0 + 0.02 * (i % SAMPLES) as f32).collect(),
        min_transmittance: 1e-3,
        thinning: None,
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
        shortest([&mut || drop(ours()), &mut || drop(burns())]),
    );
    line(
        "compositing, both ways",
        shortest([&mut || drop(ours().sum().backward()), &mut || {
            drop(burns().sum().backward())
        }]),
    );
}

fn adams(device: &Device) {
    let rates = AdamRates::new(1e-2, 0.9, 0.999, 1e-8, 3);
    let tensor =
        || Tensor::<1>::from_data(TensorData::new(many(PARAMETERS, 1.0), [PARAMETERS]), device);
    let grad = tensor();
    // Each has its own, and gives it up at each update as the optimiser does.
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
    line("Adam, a million numbers", shortest([&mut ours, &mut burns]));
}

fn measure() {
    println!(
        "{} samples, {BONES} bones, volume of {SIDE}³",
        RAYS * SAMPLES
    );
    println!(
        "{:<28} {:>8} {:>10} {:>7}",
        "operation", "ours ms", "Burn's ms", "ratio"
    );
    let device = Device::flex();
    warps(&device.clone().autodiff());
    composites(&device.clone().autodiff());
    adams(&device);
}

fn main() -> Result<(), rayon::ThreadPoolBuildError> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()?
        .install(measure);
    Ok(())
}
