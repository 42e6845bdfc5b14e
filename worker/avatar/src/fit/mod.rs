//! Fit of a pose to a picture, with the model as it is: Gauss–Newton steps on opacity and
//! brightness, which are compared where both pictures are blurred.

mod change;
mod grid;
mod jacobian;
mod normal;

use crate::avatar::{Avatar, Posed};
use crate::config::ModelConfig;
use crate::motion::body::Body;
use crate::render::RenderError;
use crate::render::composite::composite;
use crate::render::frame::read;
use crate::render::march::{Volume, march};
use crate::render::occupancy::Occupancy;
use crate::render::samples::Samples;
use burn::tensor::{Device, Tensor, TensorData};
pub(crate) use change::PoseChange;
use grid::PixelGrid;
use jacobian::HostPose;
use normal::Normal;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use tracing::trace_span;
use yoto_capture::FrameImage;
use yoto_capture::body_box::BodyView;
use yoto_capture::camera::{Camera, Pose};

/// Weight of a colour beside the opacity, 1 / √3: the three together count as much.
const COLOUR: f32 = 0.577;
/// What a fit compares, as weights of red, green, blue and opacity: the opacity, and the
/// brightness over black.
const SEEN: [[f32; 4]; 2] = [[0.0, 0.0, 0.0, 1.0], [COLOUR, COLOUR, COLOUR, 0.0]];
/// A difference that counts half, of values up to 1: what neither pose nor model explain, such as
/// another object, should not pull.
const ROBUST: f64 = 0.3;
/// Longest turn of a joint in a step, radians: beyond it, a step's linear picture of the pose does
/// not hold.
const MAX_TURN: f64 = 0.3;

/// A person of a model whose pose is fitted. No gradient flows to the model, whose parameters
/// must not be tracked.
pub(crate) struct PoseFitter<'a> {
    pub avatar: &'a Avatar,
    pub config: &'a ModelConfig,
    pub body: &'a Body,
    pub slot: usize,
    /// Completed fraction of the run.
    pub progress: f64,
    pub occupancy: Option<&'a Occupancy>,
    /// A device that differentiates.
    pub device: &'a Device,
}

/// A picture to fit to.
pub(crate) struct Picture<'a> {
    pub image: &'a FrameImage,
    pub camera: &'a Camera,
    /// Indices of the pixels that show the person.
    pub covered: &'a [u32],
}

/// A step that a parameter should take, apart from what the picture says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Wish {
    pub step: f64,
    /// One over its variance.
    pub precision: f64,
}

/// What every parameter should do without a picture.
pub(crate) struct Wishes {
    /// Return to the given pose.
    pub given: Vec<Wish>,
    /// The same, and agree with neighbours.
    pub all: Vec<Wish>,
}

/// A step that fits best, and how far the pose before it was from the picture.
pub(crate) struct Fit {
    /// `[3 (K + 1)]`.
    pub step: Vec<f64>,
    /// The square of the difference from the picture as a share of the picture's square, both
    /// blurred.
    pub misfit: f64,
    /// What the picture alone says of the expected errors of rotations, and of the place.
    pub evidence: [Evidence; 2],
}

/// How well expected errors agree with what a fit finds.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Evidence {
    /// Sum of the squared changes of the parameters from their given values, in units of the
    /// expected errors.
    pub squares: f64,
    /// Number of parameters that the picture determines: the sum that is to be expected (the
    /// effective number of parameters of MacKay's evidence framework, Neural Computation 4, 1992).
    pub determined: f64,
}

impl PoseFitter<'_> {
    /// The step from `pose` that fits best to `picture` and to the `wishes` for each
    /// parameter: rotations of the joints in their own posed axes, radians, and the shift of the
    /// root in its own axes, metres. Pictures are blurred by the share `blur` of the person's
    /// longer side; `noise` is the expected difference of their values. No step where the model shows
    /// nothing; `None` where the picture does not show the person.
    ///
    /// # Errors
    /// If the device fails.
    pub fn step(
        &self,
        pose: &Pose,
        picture: &Picture,
        wishes: &Wishes,
        blur: f64,
        noise: f64,
        rng: &mut ChaCha8Rng,
    ) -> Result<Option<Fit>, RenderError> {
        // Each pixel shows one of both, so that one pass through the model gives all gradients.
        let mut grids = Vec::with_capacity(SEEN.len());
        for weights in SEEN {
            let offset = std::array::from_fn(|_| rng.random());
            let Some(grid) = PixelGrid::new(picture.image, picture.covered, blur, offset) else {
                return Ok(None);
            };
            grids.push((grid, weights));
        }
        let pixels: Vec<usize> = (grids.iter())
            .flat_map(|(grid, _)| grid.pixels.iter().copied())
            .collect();
        let weights: Vec<[f32; 4]> = (grids.iter())
            .flat_map(|(grid, weights)| grid.pixels.iter().map(|_| *weights))
            .collect();
        let Self { config, body, .. } = *self;
        let (posed, host) = trace_span!("fit: pose").in_scope(|| {
            let posed = self
                .avatar
                .pose(config, body, self.slot, pose, self.progress);
            HostPose::new(body, pose, &posed).map(|host| (posed, host))
        })?;
        let samples =
            trace_span!("fit: march").in_scope(|| self.samples(pose, picture, &pixels, &host));
        let width = wishes.all.len();
        if samples.live() == 0 {
            let step = vec![0.0; width];
            return Ok(Some(Fit {
                step,
                misfit: 1.0,
                evidence: [Evidence::default(); 2],
            }));
        }
        let mut normal = Normal::new(width);
        let mut misfit = Misfit::default();
        let (shown, to_warped) = trace_span!("fit: gradients")
            .in_scope(|| self.gradients(&posed, &samples, &weights))?;
        let rows = trace_span!("fit: joints")
            .in_scope(|| jacobian::rows(body, &host, config.motion.unposing, &samples, to_warped));
        let _solve = trace_span!("fit: solve").entered();
        let mut first = 0;
        for (grid, weights) in &grids {
            let here = first..first + grid.pixels.len();
            first = here.end;
            let differences = misfit.add(grid, picture.image, *weights, &shown[here.clone()]);
            let rows = grid.blur(&rows[width * here.start..width * here.end], width);
            for (row, difference) in rows.chunks_exact(width).zip(differences) {
                let trust = 1.0 / (1.0 + (difference / ROBUST).powi(2));
                normal.ask(row, difference, grid.independent() * trust / noise.powi(2));
            }
        }
        let evidence = evidence(normal.clone(), &wishes.given);
        for (i, wish) in wishes.all.iter().enumerate() {
            normal.hold(i, wish.step, wish.precision);
        }
        let found = normal.solve().map(limited).zip(misfit.share());
        Ok(found.map(|(step, misfit)| Fit {
            step,
            misfit,
            evidence,
        }))
    }

    /// How far what the model shows in `pose` is from `picture`, both blurred as by
    /// [`Self::step`]: the square of the difference as a share of the picture's square; `None` where
    /// the picture does not show the person. `offset` in [0, 1)² shifts the compared pixels within a
    /// cell.
    ///
    /// # Errors
    /// If the device fails.
    pub fn misfit(
        &self,
        pose: &Pose,
        picture: &Picture,
        blur: f64,
        offset: [f64; 2],
    ) -> Result<Option<f64>, RenderError> {
        let Some(grid) = PixelGrid::new(picture.image, picture.covered, blur, offset) else {
            return Ok(None);
        };
        let Self { config, body, .. } = *self;
        let posed = self
            .avatar
            .pose(config, body, self.slot, pose, self.progress);
        let host = HostPose::new(body, pose, &posed)?;
        let samples = self.samples(pose, picture, &grid.pixels, &host);
        if samples.live() == 0 {
            return Ok(Some(1.0));
        }
        let (points, likelihood) = self.warped(&samples);
        let seen = read(self.seen(&posed, &samples, points, likelihood))?;
        let mut misfit = Misfit::default();
        for channel in 0..4 {
            let mut weights = [0.0; 4];
            weights[channel] = if channel == 3 { 1.0 } else { COLOUR };
            let shown = seen.iter().skip(channel).step_by(4);
            let shown: Vec<f32> = shown.map(|v| weights[channel] * v).collect();
            misfit.add(&grid, picture.image, weights, &shown);
        }
        Ok(misfit.share())
    }

    /// The live samples of the rays through `pixels`.
    fn samples(
        &self,
        pose: &Pose,
        picture: &Picture,
        pixels: &[usize],
        host: &HostPose,
    ) -> Samples {
        let sight = BodyView::new(&self.body.skeleton, pose, picture.camera);
        let width = picture.image.width;
        let rays: Vec<_> = (pixels.iter())
            .map(|p| sight.ray((p % width) as f64 + 0.5, (p / width) as f64 + 0.5))
            .collect();
        let volume = Volume {
            weights: &host.weights,
            transforms: &host.transforms,
            grid: &self.body.grid,
            unposing: self.config.motion.unposing,
            occupancy: self.occupancy,
            step: None,
        };
        march(&rays, &self.config.march, None::<&mut ChaCha8Rng>, &volume).all()
    }

    /// The canonical points `[n, 3]` and the likelihoods `[n]` of `samples`.
    fn warped(&self, samples: &Samples) -> (Tensor<2>, Tensor<1>) {
        let n = samples.live();
        let points = TensorData::new(samples.canonical.clone(), [n, 3]);
        let likelihood = TensorData::new(samples.likelihoods.clone(), [n]);
        (
            Tensor::from_data(points, self.device),
            Tensor::from_data(likelihood, self.device),
        )
    }

    /// Red, green, blue and opacity of the rays of `samples`, `[R, 4]`.
    fn seen(
        &self,
        posed: &Posed,
        samples: &Samples,
        points: Tensor<2>,
        likelihood: Tensor<1>,
    ) -> Tensor<2> {
        let values = self.avatar.fields(self.config, self.body, posed, points);
        let seen = composite(
            samples,
            self.config.march.min_transmittance,
            None,
            values.rgb,
            values.density,
            likelihood,
        );
        Tensor::cat(vec![seen.rgb, seen.alpha.unsqueeze_dim::<2>(1)], 1)
    }

    /// What the rays of `samples` show, by the `weights` of red, green, blue and opacity of each:
    /// `[R]`, and its gradients `[n, 4]` to the samples' canonical points and likelihoods.
    fn gradients(
        &self,
        posed: &Posed,
        samples: &Samples,
        weights: &[[f32; 4]],
    ) -> Result<(Vec<f32>, Vec<f32>), RenderError> {
        let n = samples.live();
        let (points, likelihood) = self.warped(samples);
        let (points, likelihood) = (points.require_grad(), likelihood.require_grad());
        let seen = self.seen(posed, samples, points.clone(), likelihood.clone());
        let weights = TensorData::new(weights.concat(), [weights.len(), 4]);
        let weights = Tensor::<2>::from_data(weights, self.device);
        let seen = (seen * weights).sum_dim(1);
        let shown = read(seen.clone().detach())?;
        let grads = seen.sum().backward();
        let none = |width: usize| vec![0.0; n * width];
        let to_points = points.grad(&grads).map_or_else(|| Ok(none(3)), read)?;
        let to_likelihood = likelihood.grad(&grads).map_or_else(|| Ok(none(1)), read)?;
        let (to_points, _) = to_points.as_chunks::<3>();
        let to_warped = (to_points.iter().zip(to_likelihood))
            .flat_map(|([x, y, z], likelihood)| [*x, *y, *z, likelihood])
            .collect();
        Ok((shown, to_warped))
    }
}

/// What the equations of a picture say of the expected errors in the wishes for the `given` pose.
fn evidence(mut normal: Normal, given: &[Wish]) -> [Evidence; 2] {
    let mut evidence = [Evidence::default(); 2];
    for (i, wish) in given.iter().enumerate() {
        normal.hold(i, wish.step, wish.precision);
    }
    let Some((step, variances)) = normal.solve_with_variances() else {
        return evidence;
    };
    let turns = given.len() - 3;
    for (i, wish) in given.iter().enumerate() {
        let of = &mut evidence[usize::from(i >= turns)];
        of.squares += wish.precision * (step[i] - wish.step).powi(2);
        of.determined += 1.0 - wish.precision * variances[i];
    }
    evidence
}

/// Squares of blurred differences, and of what is blurred.
#[derive(Default)]
struct Misfit {
    differences: f64,
    truth: f64,
}

impl Misfit {
    /// Adds what the pixels of `grid` show by the `weights` of red, green, blue and opacity, and
    /// returns the blurred differences from `image`.
    fn add(
        &mut self,
        grid: &PixelGrid,
        image: &FrameImage,
        weights: [f32; 4],
        shown: &[f32],
    ) -> Vec<f64> {
        let wanted = grid
            .pixels
            .iter()
            .map(|pixel| truth(image, *pixel, weights));
        let wanted: Vec<f64> = wanted.map(f64::from).collect();
        let differences: Vec<f64> = (wanted.iter().zip(shown))
            .map(|(wanted, shown)| wanted - f64::from(*shown))
            .collect();
        let (differences, wanted) = (grid.blur(&differences, 1), grid.blur(&wanted, 1));
        let squares = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>();
        self.differences += squares(&differences);
        self.truth += squares(&wanted);
        differences
    }

    /// The differences as a share of the truth; `None` if the truth is nothing.
    fn share(&self) -> Option<f64> {
        (self.truth > 0.0).then(|| self.differences / self.truth)
    }
}

/// What a pixel shows, by the `weights` of red, green, blue and opacity.
fn truth(image: &FrameImage, pixel: usize, weights: [f32; 4]) -> f32 {
    let rgb = &image.rgb[3 * pixel..3 * pixel + 3];
    let values = rgb.iter().chain([&image.mask[pixel]]);
    let sum = values
        .zip(weights)
        .map(|(value, by)| f32::from(*value) * by);
    sum.sum::<f32>() / 255.0
}

/// `step`, shortened if a joint turns too far.
fn limited(mut step: Vec<f64>) -> Vec<f64> {
    let turns = step.len() - 3;
    let longest = step[..turns]
        .as_chunks::<3>()
        .0
        .iter()
        .map(|turn| turn.iter().map(|v| v * v).sum::<f64>().sqrt())
        .fold(0.0, f64::max);
    if longest > MAX_TURN {
        step.iter_mut().for_each(|v| *v *= MAX_TURN / longest);
    }
    step
}
