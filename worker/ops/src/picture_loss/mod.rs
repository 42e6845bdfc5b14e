//! Loss of a picture against a frame and its mask: the mean absolute difference of colours and 1 − SSIM, as in 3D
//! Gaussian splatting (arXiv 2308.04079, eq. 7), and the mean squared difference between opacity and mask. SSIM is
//! that of Wang and others (2004, eq. 13) with a Gaussian window. A whole picture has a hundred times the pixels of
//! a step's patches; Burn's operations on it would take most of the step.

mod autodiff;
pub mod cpu;
#[cfg(feature = "gpu")]
mod cube;
pub mod reference;
mod window;

use super::has_own_form;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, backend_extension};
use burn::tensor::Tensor;
use std::sync::Arc;

/// Constants of SSIM for colours in [0, 1], (K₁ L)² and (K₂ L)² with L = 1.
const C1: f32 = 0.01 * 0.01;
const C2: f32 = 0.03 * 0.03;

/// The frame that a picture is compared with.
#[derive(Clone, Debug)]
pub struct Target {
    /// Width, pixels.
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    /// `[H, W, 3]`, over black.
    pub rgb: Arc<[u8]>,
    /// `[H, W]`, coverage by the person.
    pub mask: Arc<[u8]>,
    /// Columns and rows in which colours are compared: first column, first row, one past the last
    /// column, one past the last row. Opacity is compared everywhere.
    pub region: [usize; 4],
    /// Weights of the terms.
    pub weights: Weights,
}

/// Weights of the terms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights {
    /// Weight of the mean absolute difference.
    pub absolute: f32,
    /// Weight of 1 − SSIM.
    pub ssim: f32,
    /// Weight of the squared difference between opacity and mask, summed over the picture and divided by
    /// the number of pixels of the region. Each pixel is weighted by |2 m − 1|, the distance of its coverage m from
    /// a half.
    pub mask: f32,
}

impl Target {
    /// Width and height of the region.
    fn size(&self) -> [usize; 2] {
        let [x0, y0, x1, y1] = self.region;
        [x1 - x0, y1 - y0]
    }

    /// Pixels of the region, row by row.
    fn pixels(&self) -> impl Iterator<Item = usize> {
        let [x0, y0, x1, y1] = self.region;
        let width = self.width;
        (y0..y1).flat_map(move |y| (x0..x1).map(move |x| y * width + x))
    }

    /// # Panics
    /// If the sizes do not match.
    fn check(&self) {
        let [x0, y0, x1, y1] = self.region;
        let area = self.width * self.height;
        assert!(
            self.rgb.len() == 3 * area && self.mask.len() == area,
            "{} and {} bytes for {} x {} pixels",
            self.rgb.len(),
            self.mask.len(),
            self.width,
            self.height
        );
        assert!(
            x0 < x1 && y0 < y1 && x1 <= self.width && y1 <= self.height,
            "region {:?} of {} x {} pixels",
            self.region,
            self.width,
            self.height
        );
    }
}

/// The loss as a backend implements it. Call [`picture_loss`] instead, which chooses the form for
/// the tensors' device.
#[backend_extension(Autodiff, Flex, Cube: cfg(feature = "gpu"), Fusion: cfg(feature = "gpu"))]
pub trait PictureLossOps: Backend {
    /// [`picture_loss`], and its gradient to the picture `[H W, 4]`.
    #[fusion(meta = |picture, _| (terms(picture), picture.clone()))]
    fn picture_loss(
        picture: FloatTensor<Self>,
        target: Target,
    ) -> (FloatTensor<Self>, FloatTensor<Self>);
    /// The first of the numbers `grad` `[4]` times `gradient` `[H W, 4]`.
    #[fusion(dtype = gradient, shape = gradient)]
    fn picture_loss_backward(
        gradient: FloatTensor<Self>,
        grad: FloatTensor<Self>,
    ) -> FloatTensor<Self>;
}

/// Shape and type of the result of [`picture_loss`] for a picture of this shape and type.
#[cfg(feature = "gpu")]
fn terms(
    picture: &burn::backend::fusion::custom::TensorSpec,
) -> burn::backend::fusion::custom::TensorSpec {
    let shape = burn::tensor::Shape::new([4]);
    burn::backend::fusion::custom::TensorSpec::new(shape, picture.dtype)
}

/// `[4]`: the weighted sum, the mean absolute difference, 1 − SSIM, and the mask's term, of a
/// `picture` `[H W, 4]` of colours and opacity. Gradients flow from the sum alone.
///
/// # Panics
/// If the sizes do not match.
pub fn picture_loss(picture: Tensor<2>, target: &Target) -> Tensor<1> {
    target.check();
    assert_eq!(picture.dims(), [target.width * target.height, 4]);
    if has_own_form(&picture.device()) {
        let (terms, _) = Dispatch::picture_loss(picture.into_dispatch(), target.clone());
        Tensor::from_dispatch(terms)
    } else {
        reference::picture_loss(picture, target)
    }
}
