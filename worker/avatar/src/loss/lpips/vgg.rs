//! The convolutions of VGG16 that LPIPS uses, up to the outputs of relu1_2, relu2_2, relu3_3,
//! relu4_3 and relu5_3.

use super::LpipsError;
use super::weights::WeightsFile;
use burn::tensor::activation::relu;
use burn::tensor::module::{conv2d, max_pool2d};
use burn::tensor::ops::{ConvOptions, MaxPoolOptions};
use burn::tensor::{Device, Tensor};

/// Channels of the five tapped layers.
pub(super) const CHANNELS: [usize; 5] = [64, 128, 256, 512, 512];
/// Number of convolutions between successive taps; a pooling precedes all but the first.
const CONVOLUTIONS: [usize; 5] = [2, 2, 3, 3, 3];

struct Convolution {
    /// `[out, in, 3, 3]`.
    weight: Tensor<4>,
    bias: Tensor<1>,
}

/// The backbone: five blocks of convolutions.
pub(super) struct Vgg16 {
    blocks: Vec<Vec<Convolution>>,
}

impl Vgg16 {
    /// Reads the layers by torchvision's names: `features.N.weight`, `features.N.bias`, where N
    /// counts convolutions, activations and poolings.
    pub(super) fn load(file: &mut WeightsFile, device: &Device) -> Result<Self, LpipsError> {
        let (mut blocks, mut index, mut inputs) = (Vec::new(), 0, 3);
        for (convolutions, outputs) in CONVOLUTIONS.into_iter().zip(CHANNELS) {
            let mut block = Vec::new();
            for _ in 0..convolutions {
                let name = |part: &str| format!("features.{index}.{part}");
                block.push(Convolution {
                    weight: file.tensor(&name("weight"), [outputs, inputs, 3, 3], device)?,
                    bias: file.tensor(&name("bias"), [outputs], device)?,
                });
                inputs = outputs;
                // The convolution and its activation.
                index += 2;
            }
            // The pooling.
            index += 1;
            blocks.push(block);
        }
        Ok(Self { blocks })
    }

    /// Scaled images `[N, 3, H, W]` → a tensor `[N, C, H / 2ᵏ, W / 2ᵏ]` for each tap k.
    pub(super) fn features(&self, images: Tensor<4>) -> Vec<Tensor<4>> {
        let mut taps: Vec<Tensor<4>> = Vec::with_capacity(self.blocks.len());
        let mut next = images;
        for (k, block) in self.blocks.iter().enumerate() {
            if k > 0 {
                next = max_pool2d(next, MaxPoolOptions::new([2, 2]));
            }
            for layer in block {
                let options = ConvOptions::new([1, 1], [1, 1], [1, 1], 1);
                next = relu(conv2d(
                    next,
                    layer.weight.clone(),
                    Some(layer.bias.clone()),
                    options,
                ));
            }
            taps.push(next.clone());
        }
        taps
    }
}
