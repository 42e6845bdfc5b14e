//! Gradients of the transposed convolution. They flow to the volume and to the kernels.

use super::DeconvOps;
use crate::autodiff::{Saved, constants, record};
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend};

#[derive(Clone, Debug)]
struct SavedDeconv<B: Backend> {
    volume: FloatTensor<B>,
    kernels: FloatTensor<B>,
}

impl<B: DeconvOps> Saved<B, 2> for SavedDeconv<B> {
    fn gradients(self, grad: FloatTensor<B>, _: [bool; 2]) -> [FloatTensor<B>; 2] {
        B::deconv_backward(self.volume, self.kernels, grad).into()
    }
}

impl<B: DeconvOps, C: CheckpointStrategy> DeconvOps for Autodiff<B, C> {
    fn deconv(volume: FloatTensor<Self>, kernels: FloatTensor<Self>) -> FloatTensor<Self> {
        record::<B, C, _, _>([volume, kernels], |[volume, kernels]| {
            let output = B::deconv(volume.clone(), kernels.clone());
            (output, SavedDeconv { volume, kernels })
        })
    }

    fn deconv_backward(
        volume: FloatTensor<Self>,
        kernels: FloatTensor<Self>,
        grad: FloatTensor<Self>,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        constants::<B, C, _, _>([volume, kernels, grad], |[volume, kernels, grad]| {
            B::deconv_backward(volume, kernels, grad).into()
        })
        .into()
    }
}
