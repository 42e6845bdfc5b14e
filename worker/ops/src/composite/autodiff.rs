//! Gradients of compositing. They flow to colours, densities and likelihoods, not to the positions of the
//! samples.

use super::{CompositeOps, RaySamples};
use crate::autodiff::{Saved, constants, record};
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend};

#[derive(Clone, Debug)]
struct SavedComposite<B: Backend> {
    rgb: FloatTensor<B>,
    density: FloatTensor<B>,
    likelihood: FloatTensor<B>,
    samples: RaySamples,
}

impl<B: CompositeOps> Saved<B, 3> for SavedComposite<B> {
    fn gradients(self, grad: FloatTensor<B>, _: [bool; 3]) -> [FloatTensor<B>; 3] {
        B::composite_backward(self.rgb, self.density, self.likelihood, grad, self.samples).into()
    }
}

impl<B: CompositeOps, C: CheckpointStrategy> CompositeOps for Autodiff<B, C> {
    fn composite(
        rgb: FloatTensor<Self>,
        density: FloatTensor<Self>,
        likelihood: FloatTensor<Self>,
        samples: RaySamples,
    ) -> FloatTensor<Self> {
        record::<B, C, _, _>([rgb, density, likelihood], |[rgb, density, likelihood]| {
            let output = B::composite(
                rgb.clone(),
                density.clone(),
                likelihood.clone(),
                samples.clone(),
            );
            let saved = SavedComposite {
                rgb,
                density,
                likelihood,
                samples,
            };
            (output, saved)
        })
    }

    fn composite_backward(
        rgb: FloatTensor<Self>,
        density: FloatTensor<Self>,
        likelihood: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        samples: RaySamples,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        constants::<B, C, _, _>(
            [rgb, density, likelihood, grad],
            |[rgb, density, likelihood, grad]| {
                B::composite_backward(rgb, density, likelihood, grad, samples).into()
            },
        )
        .into()
    }
}
