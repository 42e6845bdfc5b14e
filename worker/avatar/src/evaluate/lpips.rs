//! LPIPS of whole images, not scaled: published tables often give it times 1000.

use crate::loss::lpips::{Lpips, LpipsError, LpipsWeights, SMALLEST_SIDE};
use burn::tensor::{Device, Tensor, TensorData};

/// LPIPS, with its networks on a device.
pub struct LpipsMetric {
    lpips: Lpips,
    device: Device,
}

impl LpipsMetric {
    /// Loads the networks from these files, on `device`.
    ///
    /// # Errors
    /// When a file does not hold the expected weights.
    pub fn load(weights: &LpipsWeights, device: &Device) -> Result<Self, LpipsError> {
        let device = device.clone().inner();
        let lpips = Lpips::load(weights, &device)?;
        Ok(Self { lpips, device })
    }

    /// Takes loaded weights, which must be on `device` without automatic differentiation.
    pub fn new(lpips: Lpips, device: &Device) -> Self {
        Self {
            lpips,
            device: device.clone().inner(),
        }
    }

    /// Distance of two images `[height, width, 3]` with values in [0, 1]; 0 for equal images.
    ///
    /// # Errors
    /// If the length of an image does not match its size, a side is shorter than
    /// [`SMALLEST_SIDE`], or the device fails.
    pub fn distance(
        &self,
        a: &[f32],
        b: &[f32],
        width: usize,
        height: usize,
    ) -> Result<f64, LpipsError> {
        if width < SMALLEST_SIDE || height < SMALLEST_SIDE {
            return Err(LpipsError::TooSmall { width, height });
        }
        let image = |values: &[f32]| {
            if values.len() != width * height * 3 {
                return Err(LpipsError::ImageLength {
                    width,
                    height,
                    found: values.len(),
                });
            }
            let data = TensorData::new(values.to_vec(), [1, height, width, 3]);
            let image = Tensor::<4>::from_data(data, &self.device);
            Ok(image.permute([0, 3, 1, 2]) * 2.0 - 1.0)
        };
        let distance: Vec<f32> = self
            .lpips
            .distance(image(a)?, image(b)?)
            .try_into_vec_as()
            .map_err(|error| LpipsError::Device(format!("{error:?}")))?;
        match distance.first() {
            Some(distance) => Ok(f64::from(*distance)),
            None => Err(LpipsError::Device("the device returned no distance".into())),
        }
    }
}
