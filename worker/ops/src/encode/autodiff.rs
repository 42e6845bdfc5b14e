//! Gradients of frequency encodings. They flow to the points.

use super::{Bands, EncodeOps};
use crate::autodiff::{Saved, constants, record};
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend};

#[derive(Clone, Debug)]
struct SavedFrequencies<B: Backend> {
    /// The result, which has the derivatives: that of a sine is its cosine.
    encoded: FloatTensor<B>,
    bands: Bands,
}

impl<B: EncodeOps> Saved<B, 1> for SavedFrequencies<B> {
    fn gradients(self, grad: FloatTensor<B>, _: [bool; 1]) -> [FloatTensor<B>; 1] {
        [B::frequencies_backward(self.encoded, grad, self.bands)]
    }
}

impl<B: EncodeOps, C: CheckpointStrategy> EncodeOps for Autodiff<B, C> {
    fn frequencies(points: FloatTensor<Self>, bands: Bands) -> FloatTensor<Self> {
        record::<B, C, _, _>([points], |[points]| {
            let encoded = B::frequencies(points, bands.clone());
            (encoded.clone(), SavedFrequencies { encoded, bands })
        })
    }

    fn frequencies_backward(
        encoded: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        bands: Bands,
    ) -> FloatTensor<Self> {
        let [to_points] = constants::<B, C, _, _>([encoded, grad], |[encoded, grad]| {
            [B::frequencies_backward(encoded, grad, bands)]
        });
        to_points
    }
}
