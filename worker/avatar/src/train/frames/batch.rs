//! The loss of a batch of rays: pose, march, fields, compositing, comparison. It is separate from
//! the trainer, which draws the batches, so that tests can check its gradients with fixed rays.
//!
//! Each stage is a trace span, as are the trainer's: `yoto-lab bench` measures the stages of a step by
//! them.

use crate::avatar::{Avatar, AvatarAppearance};
use crate::config::ModelConfig;
use crate::host::read;
use crate::loss::{LossTerm, Objective, Patches, total};
use crate::motion::body::CanonicalBody;
use crate::render::composite::{Composite, composite};
use crate::render::march::{Volume, march};
use crate::render::occupancy::{DensityObservations, Occupancy};
use crate::render::{RenderError, SampleCounts};
use burn::tensor::{Tensor, TensorData};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use tracing::trace_span;
use yoto_capture::body_box::Ray;
use yoto_capture::camera::Pose;
use yoto_ops::composite::GradientSubsampling;

/// Rays of a training step, and their ground truth.
pub struct Batch {
    /// `[P S²]`, patch by patch, row by row; `None` for rays that miss the body's box.
    pub rays: Vec<Option<Ray>>,
    /// S: side length of a patch, pixels.
    pub patch_size: usize,
    /// `[P, S², 3]`, over `background`.
    pub truth: Vec<f32>,
    /// `[P S²]`, coverage of the person by the mask, 0 to 1.
    pub coverage: Vec<f32>,
    /// Colour behind the person.
    pub background: [f32; 3],
}

/// The identity and pose that a batch shows, and the state of training.
pub struct Scene<'a> {
    /// Configuration of the model.
    pub config: &'a ModelConfig,
    /// The identity's body.
    pub body: &'a CanonicalBody,
    /// Its slot in the model.
    pub slot: usize,
    /// Its pose.
    pub pose: &'a Pose,
    /// Completed fraction of the run, which determines the active parts of the model.
    pub schedule_progress: f64,
    /// Number of the step, which selects the empty cells that are probed.
    pub step: u64,
    /// Occupancy grid of the identity.
    pub occupancy: Option<&'a Occupancy>,
}

/// Result of a batch.
pub struct Outcome {
    /// `[1]`: the weighted sum of the terms.
    pub loss: Tensor<1>,
    /// Terms of the objective.
    pub terms: Vec<LossTerm>,
    /// Colour, opacity and depth of the rays.
    pub seen: Composite,
    /// Sample counts.
    pub counts: SampleCounts,
    /// Densities for the occupancy grid; absent without one.
    pub observations: Option<DensityObservations>,
}

/// Mean squared difference between `opacity` `[R]` and `coverage` `[R]`. A pixel counts by how far
/// its coverage is from a half: where a mask is soft, its author was uncertain.
fn off_the_mask(opacity: Tensor<1>, coverage: &[f32]) -> Tensor<1> {
    let device = opacity.device();
    let trust: Vec<f32> = coverage.iter().map(|m| (2.0 * m - 1.0).abs()).collect();
    let column = |values: &[f32]| Tensor::<1>::from_floats(values, &device);
    let difference = opacity - column(coverage);
    (difference.clone() * difference * column(&trust)).mean()
}

/// The outcome of `batch`; `None` if no ray has a live sample. With `jitter`, samples are random in
/// their strata and gradients flow to [`OptimiseConfig::backward_share`] of them; without it,
/// samples are in the middle and gradients flow to all.
///
/// # Errors
/// If the device fails, the objective has no terms, or the model has splats.
///
/// [`OptimiseConfig::backward_share`]: crate::config::OptimiseConfig::backward_share
pub fn outcome(
    avatar: &Avatar,
    scene: &Scene,
    batch: &Batch,
    objective: &dyn Objective,
    mut jitter: Option<&mut ChaCha8Rng>,
) -> Result<Option<Outcome>, RenderError> {
    let Scene { config, body, .. } = *scene;
    let field = match avatar.appearance(config) {
        AvatarAppearance::Field(field) => field,
        AvatarAppearance::Splats(_) => {
            let tier = &config.tier;
            let message = format!("the tier {tier} has splats, which no ray meets");
            return Err(RenderError::Settings(message));
        }
    };
    let (posed, weights, transforms) = trace_span!("pose").in_scope(|| {
        let posed = avatar.pose(
            config,
            body,
            scene.slot,
            scene.pose,
            scene.schedule_progress,
        );
        let weights = read(posed.weights.clone())?;
        let transforms = read(posed.known_transforms())?;
        Ok::<_, RenderError>((posed, weights, transforms))
    })?;
    let volume = Volume {
        weights: &weights,
        transforms: &transforms,
        grid: &body.grid,
        unposing: config.motion.unposing,
        occupancy: scene.occupancy,
        step: Some(scene.step),
    };
    let (mut samples, counts) = trace_span!("march").in_scope(|| {
        let candidates = march(
            &batch.rays,
            &field.config.march,
            jitter.as_deref_mut(),
            &volume,
        );
        let samples = candidates.all();
        let counts = SampleCounts {
            evaluated: samples.live() as u64,
            ..candidates.counts()
        };
        (samples, counts)
    });
    if samples.live() == 0 {
        return Ok(None);
    }
    let device = posed.weights.device();
    let points = TensorData::new(samples.points.clone(), [samples.live(), 3]);
    let points = Tensor::from_data(points, &device);
    let near = TensorData::new(samples.canonical.clone(), [samples.live(), 3]);
    let near = Tensor::from_data(near, &device);
    let (values, canonical, likelihood) =
        trace_span!("fields").in_scope(|| field.evaluate(body, &posed, points, Some(near)));
    let observations = match scene.occupancy {
        Some(_) => Some(DensityObservations {
            // Not the points that the march found: where the two disagree, it is no offset.
            canonical: read(canonical.detach())?,
            moved: read(values.points.detach())?,
            densities: read(values.density.clone().detach())?,
            likelihoods: std::mem::take(&mut samples.likelihoods),
        }),
        None => None,
    };
    let _span = trace_span!("composite").entered();
    let share = config.optimise.backward_share;
    let subsampling = jitter
        .filter(|_| share < 1.0)
        .map(|rng| GradientSubsampling {
            share,
            density_scale: field.config.canonical.density_scale,
            seed: rng.random(),
        });
    let seen = composite(
        &samples,
        field.config.march.min_transmittance,
        subsampling,
        values.rgb,
        values.density,
        likelihood,
    );
    let background = Tensor::<1>::from_floats(batch.background, &device).unsqueeze::<2>();
    let clear = (seen.alpha.clone().neg() + 1.0).unsqueeze_dim::<2>(1);
    let area = (batch.patch_size * batch.patch_size).max(1);
    let shape = [batch.rays.len() / area, area, 3];
    let predicted = (seen.rgb.clone() + clear * background).reshape(shape);
    let truth = Tensor::<3>::from_data(TensorData::new(batch.truth.clone(), shape), &device);
    let patches = Patches {
        predicted,
        truth,
        side: batch.patch_size,
    };
    let mut terms = objective.terms(patches);
    if config.optimise.mask_weight > 0.0 {
        terms.push(LossTerm {
            name: "mask",
            weight: config.optimise.mask_weight,
            value: off_the_mask(seen.alpha.clone(), &batch.coverage),
        });
    }
    let loss = total(&terms).ok_or_else(|| {
        RenderError::Settings(format!("the objective {} has no terms", objective.name()))
    })?;
    Ok(Some(Outcome {
        loss,
        terms,
        seen,
        counts,
        observations,
    }))
}
