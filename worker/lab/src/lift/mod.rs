//! Learns the network that finds the depth of key points, from motions.

mod motions;
mod net;

pub use motions::read_motions;

use crate::display::Screen;
use anyhow::{Context, ensure};
use burn::grad_clipping::GradientClippingConfig;
use burn::optim::{AdamConfig, GradientsParams};
use burn::tensor::{Device, Tensor, TensorData};
use net::LiftNet;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use yoto_pose::lift::learn::{DetectorErrors, Examples, MotionClip};
use yoto_pose::lift::network::Network;
use yoto_pose::lift::{BONES, COUNT, INPUTS, told_depth};

/// Examples per step.
const BATCH: usize = 512;
/// Learning rate at the start and at the end.
const RATE: [f64; 2] = [1e-3, 1e-5];
/// Largest norm of a parameter's gradient.
const CLIPPED: f32 = 0.1;
/// Of this number of clips, one is kept to measure on.
const KEPT: usize = 10;
/// Examples to measure on.
const MEASURED: usize = 8192;
/// Steps between two lines of progress.
const EVERY: usize = 500;

/// How to learn.
#[derive(Clone, Copy, Debug)]
pub struct LiftSettings {
    /// Steps.
    pub steps: usize,
    /// Seed of the first weights and of the examples.
    pub seed: u64,
}

/// What was learned.
#[derive(Debug)]
pub struct Learned {
    /// The network.
    pub network: Network,
    /// Mean error of each bone's depth on motions that were kept, millimetres, by the network and as the detector tells it.
    pub bones_mm: Vec<[f64; 2]>,
}

/// Learns the network from `clips`.
///
/// # Errors
/// If there are too few motions, or the network does not stay finite.
pub fn learn(
    clips: Vec<MotionClip>,
    errors: DetectorErrors,
    settings: LiftSettings,
    screen: &dyn Screen,
) -> anyhow::Result<Learned> {
    let (mut kept, mut taken) = (Vec::new(), Vec::new());
    for (at, clip) in clips.into_iter().enumerate() {
        match at % KEPT {
            0 => kept.push(clip),
            _ => taken.push(clip),
        }
    }
    ensure!(
        !kept.is_empty() && !taken.is_empty(),
        "too few motions: give at least two clips"
    );
    let (kept, taken) = (
        Examples::new(kept, errors.clone()),
        Examples::new(taken, errors),
    );
    let device = Device::flex().autodiff();
    device.seed(settings.seed);
    let mut net = LiftNet::new(settings.seed, &device);
    let mut optimiser = AdamConfig::new()
        .with_epsilon(1e-8)
        .with_grad_clipping(Some(GradientClippingConfig::Norm(CLIPPED)))
        .init();
    let mut mean = 0.0;
    for step in 0..settings.steps {
        let batch = Batch::draw(&taken, settings.seed, step, BATCH)?;
        let loss = net.loss(batch.inputs(&device), batch.depths(&device));
        mean += f64::from(loss.clone().into_scalar::<f32>()) / EVERY as f64;
        let grads = GradientsParams::from_grads(loss.backward(), &net);
        let done = step as f64 / settings.steps as f64;
        let fall = 0.5 * (1.0 + (std::f64::consts::PI * done).cos());
        net = optimiser.step(RATE[1] + fall * (RATE[0] - RATE[1]), net, grads);
        if (step + 1) % EVERY == 0 {
            screen.note(&format!("step {}: loss {mean:.3}", step + 1));
            ensure!(mean.is_finite(), "the network did not stay finite");
            mean = 0.0;
        }
    }
    let network = net.network().context("the network that was learned")?;
    let batch = Batch::draw(&kept, settings.seed.wrapping_add(1), usize::MAX, MEASURED)?;
    Ok(Learned {
        bones_mm: batch.errors(&network),
        network,
    })
}

/// Examples of one step.
struct Batch {
    inputs: Vec<f32>,
    depths: Vec<f32>,
    count: usize,
}

impl Batch {
    fn draw(from: &Examples, seed: u64, step: usize, count: usize) -> anyhow::Result<Self> {
        let examples = (0..count).into_par_iter().map(|at| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            random.set_stream((step as u64).wrapping_mul(1 << 16).wrapping_add(at as u64));
            // An example that the random film does not show is drawn again.
            (0..16).find_map(|_| from.draw(&mut random))
        });
        let examples: Vec<_> = examples.flatten().collect();
        ensure!(examples.len() == count, "the motions have too few frames");
        Ok(Self {
            inputs: examples.iter().flat_map(|it| it.inputs.clone()).collect(),
            depths: examples.iter().flat_map(|it| it.depths).collect(),
            count,
        })
    }

    fn inputs(&self, device: &Device) -> Tensor<2> {
        let data = TensorData::new(self.inputs.clone(), [self.count, INPUTS]);
        Tensor::from_data(data, device)
    }

    fn depths(&self, device: &Device) -> Tensor<2> {
        let data = TensorData::new(self.depths.clone(), [self.count, COUNT]);
        Tensor::from_data(data, device)
    }

    /// Mean error of each bone's depth, millimetres, by the network and as the detector tells it.
    fn errors(&self, network: &Network) -> Vec<[f64; 2]> {
        let inputs = faer::MatRef::from_row_major_slice(&self.inputs, self.count, INPUTS);
        let found = network.run(inputs);
        let bone = |[from, to]: [usize; 2]| {
            let mut sums = [0.0; 2];
            for at in 0..self.count {
                let exact = |place: usize| self.depths[at * COUNT + place];
                let told = |place: usize| self.inputs[at * INPUTS + told_depth(place)];
                let wanted = exact(to) - exact(from);
                sums[0] += f64::from((found[(at, to)] - found[(at, from)] - wanted).abs());
                sums[1] += f64::from((told(to) - told(from) - wanted).abs());
            }
            sums.map(|sum| 1000.0 * sum / self.count as f64)
        };
        BONES.into_iter().map(bone).collect()
    }
}
