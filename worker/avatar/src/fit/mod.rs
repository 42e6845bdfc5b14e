//! Fit of a pose to a picture, with the model as it is: Gauss–Newton steps on opacity and
//! brightness, which are compared where both pictures are blurred.

mod change;
mod field;
mod grid;
mod jacobian;
mod normal;
mod parts;
mod splats;
#[cfg(test)]
mod test_scene;
mod wrench;

use crate::avatar::{Avatar, AvatarAppearance, Posed};
use crate::config::ModelConfig;
use crate::motion::body::CanonicalBody;
use crate::render::RenderError;
use crate::render::occupancy::Occupancy;
use burn::tensor::Device;
pub(crate) use change::PoseChange;
use grid::PixelGrid;
use jacobian::HostPose;
use normal::Normal;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use tracing::trace_span;
use yoto_capture::FrameImage;
use yoto_capture::camera::{Camera, Pose};

/// Weight of a colour beside the opacity, 1 / √3: the three together count as much.
const COLOUR: f32 = 0.577;
/// The channels that a fit compares, as weights of red, green, blue and opacity: the opacity, and the
/// brightness over black.
const CHANNELS: [[f32; 4]; 2] = [[0.0, 0.0, 0.0, 1.0], BRIGHTNESS];
/// Weights of the brightness.
const BRIGHTNESS: [f32; 4] = [COLOUR, COLOUR, COLOUR, 0.0];
/// A difference that counts half, of values up to 1: what neither pose nor model explain, such as
/// another object, should not move the pose.
const ROBUST: f64 = 0.3;
/// Largest rotation of a joint in a step, radians: beyond it, the linearisation of the pose does not
/// hold.
const MAX_ROTATION: f64 = 0.3;

/// A person of a model whose pose is fitted. No gradient flows to the model, whose parameters
/// must not be tracked.
pub(crate) struct PoseFitter<'a> {
    pub avatar: &'a Avatar,
    pub config: &'a ModelConfig,
    pub body: &'a CanonicalBody,
    pub slot: usize,
    /// Completed fraction of the run.
    pub schedule_progress: f64,
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

/// A Gaussian prior on a parameter's step, regardless of the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StepPrior {
    pub mean: f64,
    /// One over the variance.
    pub precision: f64,
}

/// The priors on the steps of all parameters.
pub(crate) struct StepPriors {
    /// The return to the given pose.
    pub given: Vec<StepPrior>,
    /// The return to the given pose, and the changes of neighbouring frames.
    pub all: Vec<StepPrior>,
}

/// A step that fits best, and how far the pose before it was from the picture.
pub(crate) struct Fit {
    /// `[3 (K + 1)]`.
    pub step: Vec<f64>,
    /// The square of the difference from the picture as a share of the picture's square, both
    /// blurred.
    pub misfit: f64,
    /// Evidence from the picture alone about the expected errors of rotations, and of the position.
    pub evidence: [Evidence; 2],
}

/// The agreement of expected errors with what a fit finds.
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
    /// The step from `pose` that fits best to `picture` and to the `priors` for each
    /// parameter: rotations of the joints in their own posed axes, radians, and the shift of the
    /// root in its own axes, metres. Pictures are blurred by the share `blur` of the person's
    /// longer side; `noise` is the expected difference of their values. No step where the model shows
    /// nothing; `None` where the picture does not show the person.
    ///
    /// # Errors
    /// If the device fails.
    pub(crate) fn step(
        &self,
        pose: &Pose,
        picture: &Picture,
        priors: &StepPriors,
        blur: f64,
        noise: f64,
        rng: &mut ChaCha8Rng,
    ) -> Result<Option<Fit>, RenderError> {
        // Each pixel shows one of both, so that one pass through the model gives all gradients.
        let mut grids = Vec::with_capacity(CHANNELS.len());
        for weights in CHANNELS {
            let offset = std::array::from_fn(|_| rng.random());
            let Some(grid) = PixelGrid::new(picture.image, picture.covered, blur, offset) else {
                return Ok(None);
            };
            grids.push((grid, weights));
        }
        if self.config.appearance.capabilities().fast_frames {
            let spread = grids[0].0.spread;
            for part in parts::boxes(&self.body.skeleton, pose, picture.camera) {
                let offset = std::array::from_fn(|_| rng.random());
                let width = picture.image.width;
                let grid = PixelGrid::over(width, part, parts::PIXELS, spread, offset);
                grids.push((grid, BRIGHTNESS));
            }
        }
        let pixels: Vec<usize> = (grids.iter())
            .flat_map(|(grid, _)| grid.pixels.iter().copied())
            .collect();
        let weights: Vec<[f32; 4]> = (grids.iter())
            .flat_map(|(grid, weights)| grid.pixels.iter().map(|_| *weights))
            .collect();
        let shown = match self.avatar.appearance(self.config) {
            AvatarAppearance::Splats(splats) => {
                self.splat_pixels_with_jacobian(splats, pose, picture, &pixels, &weights)?
            }
            AvatarAppearance::Field(field) => {
                self.field_pixels_with_jacobian(field, pose, picture, &pixels, &weights)?
            }
        };
        let width = priors.all.len();
        let Some(PixelValues { values, jacobian }) = shown else {
            let step = vec![0.0; width];
            return Ok(Some(Fit {
                step,
                misfit: 1.0,
                evidence: [Evidence::default(); 2],
            }));
        };
        let mut normal = Normal::new(width);
        let mut misfit = Misfit::default();
        let _solve = trace_span!("fit: solve").entered();
        let mut first = 0;
        for (grid, weights) in &grids {
            let here = first..first + grid.pixels.len();
            first = here.end;
            let differences = misfit.add(grid, picture.image, *weights, &values[here.clone()]);
            let rows = grid.blur(&jacobian[width * here.start..width * here.end], width);
            for (row, difference) in rows.chunks_exact(width).zip(differences) {
                let trust = 1.0 / (1.0 + (difference / ROBUST).powi(2));
                normal.add_residual(row, difference, grid.independent() * trust / noise.powi(2));
            }
        }
        let known = 3 * self.body.known_joints;
        let evidence = evidence(normal.clone(), &priors.given, known);
        for (i, prior) in priors.all.iter().enumerate() {
            normal.add_prior(i, prior.mean, prior.precision);
        }
        let found = (normal.solve().map(|step| limited(step, known))).zip(misfit.share());
        Ok(found.map(|(step, misfit)| Fit {
            step,
            misfit,
            evidence,
        }))
    }

    /// The difference of the model's picture in `pose` from `picture`, both blurred as by
    /// [`Self::step`]: the square of the difference as a share of the picture's square; `None` where
    /// the picture does not show the person. `offset` in [0, 1)² shifts the compared pixels within a
    /// cell.
    ///
    /// # Errors
    /// If the device fails.
    pub(crate) fn misfit(
        &self,
        pose: &Pose,
        picture: &Picture,
        blur: f64,
        offset: [f64; 2],
    ) -> Result<Option<f64>, RenderError> {
        let Some(grid) = PixelGrid::new(picture.image, picture.covered, blur, offset) else {
            return Ok(None);
        };
        let seen = match self.avatar.appearance(self.config) {
            AvatarAppearance::Splats(splats) => {
                self.splat_pixels(splats, pose, picture, &grid.pixels)?
            }
            AvatarAppearance::Field(field) => {
                self.field_pixels(field, pose, picture, &grid.pixels)?
            }
        };
        let Some(seen) = seen else {
            return Ok(Some(1.0));
        };
        let mut misfit = Misfit::default();
        for channel in 0..4 {
            let mut weights = [0.0; 4];
            weights[channel] = if channel == 3 { 1.0 } else { COLOUR };
            let shown = seen.iter().map(|pixel| weights[channel] * pixel[channel]);
            let shown: Vec<f32> = shown.collect();
            misfit.add(&grid, picture.image, weights, &shown);
        }
        Ok(misfit.share())
    }

    /// The person in `pose`.
    fn posed(&self, pose: &Pose) -> Result<(Posed, HostPose), RenderError> {
        let _span = trace_span!("fit: pose").entered();
        let posed = (self.avatar).pose(
            self.config,
            self.body,
            self.slot,
            pose,
            self.schedule_progress,
        );
        let host = HostPose::new(self.body, pose, &posed)?;
        Ok((posed, host))
    }
}

/// The values of pixels, each by weights of its own of red, green, blue and opacity.
struct PixelValues {
    /// `[R]`.
    values: Vec<f32>,
    /// `[R, 3 (K + 1)]`: their Jacobian to the pose, as [`wrench::jacobian`] returns it.
    jacobian: Vec<f64>,
}

/// Evidence of a picture's equations about the expected errors in the priors for the `given` pose. The first `known` parameters are those of
/// joints that are not of fingers, whose errors are others.
fn evidence(mut normal: Normal, given: &[StepPrior], known: usize) -> [Evidence; 2] {
    let mut evidence = [Evidence::default(); 2];
    for (i, prior) in given.iter().enumerate() {
        normal.add_prior(i, prior.mean, prior.precision);
    }
    let Some((step, variances)) = normal.solve_with_variances() else {
        return evidence;
    };
    let rotations = given.len() - 3;
    let of_body = (0..given.len()).filter(|i| *i < known || *i >= rotations);
    for (i, prior) in of_body.map(|i| (i, &given[i])) {
        let of = &mut evidence[usize::from(i >= rotations)];
        of.squares += prior.precision * (step[i] - prior.mean).powi(2);
        of.determined += 1.0 - prior.precision * variances[i];
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

/// The value of a pixel, by the `weights` of red, green, blue and opacity.
fn truth(image: &FrameImage, pixel: usize, weights: [f32; 4]) -> f32 {
    let rgb = &image.rgb[3 * pixel..3 * pixel + 3];
    let values = rgb.iter().chain([&image.mask[pixel]]);
    let sum = values
        .zip(weights)
        .map(|(value, by)| f32::from(*value) * by);
    sum.sum::<f32>() / 255.0
}

/// `step`, shortened if a joint turns too far. The first `known` parameters are those of joints that are not of fingers; a finger that turns
/// too far shortens its own step alone, since pictures hardly tell how it does.
fn limited(mut step: Vec<f64>, known: usize) -> Vec<f64> {
    let rotations = step.len() - 3;
    let (of_body, of_fingers) = step[..rotations].split_at_mut(known.min(rotations));
    let length = |rotation: &[f64; 3]| rotation.iter().map(|v| v * v).sum::<f64>().sqrt();
    for finger in of_fingers.as_chunks_mut::<3>().0 {
        let shorter = MAX_ROTATION / length(finger).max(MAX_ROTATION);
        finger.iter_mut().for_each(|v| *v *= shorter);
    }
    let longest = (of_body.as_chunks::<3>().0.iter())
        .map(length)
        .fold(0.0, f64::max);
    if longest > MAX_ROTATION {
        step.iter_mut().for_each(|v| *v *= MAX_ROTATION / longest);
    }
    step
}
