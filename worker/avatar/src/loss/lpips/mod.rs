//! LPIPS 0.1 with a VGG16 backbone: the perceptual difference of two images, as a loss and as a
//! metric.
//!
//! Values agree with those of the `lpips` package for Python with the same weights. Gradients
//! differ where all channels of a feature are zero: NaN there, finite here.

mod vgg;
mod weights;

use burn::tensor::{Device, Tensor};
use std::path::PathBuf;
use thiserror::Error;
use vgg::{CHANNELS, Vgg16};
use weights::WeightsFile;

/// Smallest side of an image, pixels: four poolings by 2 must leave one.
pub const SMALLEST_SIDE: usize = 16;

/// Subtracted from an image in [−1, 1], per channel.
const SHIFT: [f32; 3] = [-0.030, -0.088, -0.188];
/// Divisor of the shifted image, per channel.
const SCALE: [f32; 3] = [0.458, 0.448, 0.450];
/// Added to the norm in the division that normalises features.
const NORM_EPSILON: f64 = 1e-10;
/// Lower bound of squared norms, so that the root has a finite slope at zero. Its root vanishes
/// beside [`NORM_EPSILON`] in single precision, so no value changes.
const SQUARED_NORM_FLOOR: f64 = 1e-36;

/// Environment variable with the name of VGG16's file.
pub const VGG16_VARIABLE: &str = "YOTO_VGG16_WEIGHTS";
/// Environment variable with the name of the linear heads' file.
pub const HEADS_VARIABLE: &str = "YOTO_LPIPS_WEIGHTS";

/// Where the networks' weights are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LpipsWeights {
    /// torchvision's VGG16.
    pub vgg16: PathBuf,
    /// The linear heads of LPIPS 0.1 for VGG.
    pub heads: PathBuf,
}

impl LpipsWeights {
    /// Both files, or none. An empty name is none.
    ///
    /// # Errors
    /// When one is given without the other, which is most likely a mistake.
    pub fn both(
        vgg16: Option<PathBuf>,
        heads: Option<PathBuf>,
    ) -> Result<Option<Self>, HalfOfWeights> {
        let given = |name: Option<PathBuf>| name.filter(|name| !name.as_os_str().is_empty());
        match (given(vgg16), given(heads)) {
            (Some(vgg16), Some(heads)) => Ok(Some(Self { vgg16, heads })),
            (None, None) => Ok(None),
            (Some(_), None) => Err(HalfOfWeights::Heads),
            (None, Some(_)) => Err(HalfOfWeights::Vgg16),
        }
    }
}

/// The file of weights that is missing beside the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum HalfOfWeights {
    /// VGG16.
    #[error(
        "{HEADS_VARIABLE} is set but {VGG16_VARIABLE} is not: LPIPS needs both files of weights"
    )]
    Vgg16,
    /// The linear heads.
    #[error(
        "{VGG16_VARIABLE} is set but {HEADS_VARIABLE} is not: LPIPS needs both files of weights"
    )]
    Heads,
}

/// Why there is no LPIPS.
#[derive(Debug, Error)]
pub enum LpipsError {
    /// The file is missing, or neither safetensors nor what PyTorch saves.
    #[error("{file}: can't be read as weights: {message}", file = file.display())]
    File {
        /// Path.
        file: PathBuf,
        /// What is wrong.
        message: String,
    },
    /// The file lacks a tensor.
    #[error("{file}: there is no tensor '{tensor}', expected with shape {expected:?}", file = file.display())]
    Missing {
        /// Path.
        file: PathBuf,
        /// Its name.
        tensor: String,
        /// The shape it should have.
        expected: Vec<usize>,
    },
    /// A tensor has the wrong shape.
    #[error("{file}: tensor '{tensor}' has shape {found:?}, expected {expected:?}", file = file.display())]
    Shape {
        /// Path.
        file: PathBuf,
        /// Its name.
        tensor: String,
        /// The shape it should have.
        expected: Vec<usize>,
        /// The shape it has.
        found: Vec<usize>,
    },
    /// The values of a tensor are invalid.
    #[error("{file}: tensor '{tensor}': {message}", file = file.display())]
    Values {
        /// Path.
        file: PathBuf,
        /// Its name.
        tensor: String,
        /// What is wrong.
        message: String,
    },
    /// The images are too small.
    #[error(
        "images of {width}x{height} pixels: LPIPS needs at least {SMALLEST_SIDE}x{SMALLEST_SIDE}"
    )]
    TooSmall {
        /// Width, pixels.
        width: usize,
        /// Height, pixels.
        height: usize,
    },
    /// The length of an image does not match its size.
    #[error("an image of {width}x{height} pixels has {found} values, not three per pixel")]
    ImageLength {
        /// Width, pixels.
        width: usize,
        /// Height, pixels.
        height: usize,
        /// Number of its values.
        found: usize,
    },
    /// The device failed.
    #[error("device: {0}")]
    Device(String),
}

/// The frozen networks. Their weights are constants: gradients flow to the images only.
pub struct Lpips {
    backbone: Vgg16,
    /// Weights of the channels of each tapped layer, `[1, C, 1, 1]`.
    heads: Vec<Tensor<4>>,
    shift: Tensor<4>,
    scale: Tensor<4>,
}

impl Lpips {
    /// Reads torchvision's VGG16 (`features.0.weight`, …) and the linear heads
    /// (`lin0.model.1.weight`, …). Files with the extension `.safetensors` are read as such, all
    /// others as files of `torch.save`.
    ///
    /// # Errors
    /// Names the file, and the tensor with its expected and found shape.
    pub fn load(weights: &LpipsWeights, device: &Device) -> Result<Self, LpipsError> {
        let backbone = Vgg16::load(&mut WeightsFile::open(&weights.vgg16)?, device)?;
        let mut file = WeightsFile::open(&weights.heads)?;
        let heads = CHANNELS
            .iter()
            .enumerate()
            .map(|(layer, channels)| {
                file.tensor(
                    &format!("lin{layer}.model.1.weight"),
                    [1, *channels, 1, 1],
                    device,
                )
            })
            .collect::<Result<_, _>>()?;
        let channels =
            |values: [f32; 3]| Tensor::<1>::from_floats(values, device).reshape([1, 3, 1, 1]);
        Ok(Self {
            backbone,
            heads,
            shift: channels(SHIFT),
            scale: channels(SCALE),
        })
    }

    /// Distances `[N]` of images `[N, 3, height, width]` with values in [−1, 1]; sides of at
    /// least [`SMALLEST_SIDE`].
    ///
    /// # Panics
    /// If the images' shapes differ or a side is smaller than that.
    pub fn distance(&self, a: Tensor<4>, b: Tensor<4>) -> Tensor<1> {
        let [images, _, height, width] = a.dims();
        assert!(
            height >= SMALLEST_SIDE && width >= SMALLEST_SIDE,
            "images of {width}x{height} pixels are too small for LPIPS"
        );
        let features = |image: Tensor<4>| {
            let scaled = (image - self.shift.clone()) / self.scale.clone();
            self.backbone.features(scaled)
        };
        let pairs = features(a).into_iter().zip(features(b));
        pairs.zip(&self.heads).fold(
            Tensor::zeros([images], &self.shift.device()),
            |sum, ((a, b), head)| {
                let difference = (unit(a) - unit(b)).square();
                let weighted = (difference * head.clone()).sum_dim(1);
                sum + weighted.mean_dims(&[2, 3]).reshape([images])
            },
        )
    }
}

/// Features `[N, C, h, w]`, divided by their norm across channels.
fn unit(features: Tensor<4>) -> Tensor<4> {
    let norm = features
        .clone()
        .square()
        .sum_dim(1)
        .clamp_min(SQUARED_NORM_FLOOR)
        .sqrt();
    features / (norm + NORM_EPSILON)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_file_without_the_other_is_refused_and_none_is_none() {
        let file = |name: &str| Some(PathBuf::from(name));
        assert_eq!(LpipsWeights::both(None, file("")), Ok(None));
        let both = LpipsWeights::both(file("v.pth"), file("h.pth")).expect("both");
        let both = both.expect("weights");
        assert_eq!((both.vgg16, both.heads), ("v.pth".into(), "h.pth".into()));
        let halves = [
            (file("v.pth"), file(""), VGG16_VARIABLE, HEADS_VARIABLE),
            (None, file("h.pth"), HEADS_VARIABLE, VGG16_VARIABLE),
        ];
        for (vgg16, heads, given, missing) in halves {
            let error = LpipsWeights::both(vgg16, heads).expect_err("refused");
            let error = error.to_string();
            assert!(
                error.starts_with(given) && error.contains(missing),
                "{error}"
            );
        }
    }

    #[test]
    fn unit_features_are_the_packages_and_have_a_slope_at_zero() {
        let device = Device::flex().autodiff();
        // Positions with no feature, with tiny ones and with ordinary ones.
        let features: [f32; 8] = [0.0, 1e-15, 3e-10, 2.0, 0.0, 0.0, 4e-10, -1.0];
        let input = Tensor::<1>::from_floats(features, &device)
            .reshape([1, 2, 1, 4])
            .require_grad();
        let output = unit(input.clone());
        let grads = output.clone().sum().backward();
        let output: Vec<f32> = output.try_into_vec_as().expect("f32");
        for (i, found) in output.iter().enumerate() {
            let at = |i: usize| f64::from(features[i]);
            let norm = at(i % 4).hypot(at(i % 4 + 4));
            let expected = at(i) / (norm + 1e-10);
            assert!(
                (f64::from(*found) - expected).abs() <= 1e-6 * expected.abs(),
                "{i}: {found} {expected}"
            );
        }
        let slopes: Vec<f32> = input
            .grad(&grads)
            .expect("tracked")
            .try_into_vec_as()
            .expect("f32");
        assert!(slopes.iter().all(|s| s.is_finite()), "{slopes:?}");
        assert!(slopes[0] > 0.0, "{slopes:?}");
    }
}
