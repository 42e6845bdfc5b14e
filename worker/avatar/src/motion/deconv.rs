//! The `deconv` form of the motion weights (HumanNeRF): transposed convolutions turn an embedding
//! into a volume of logits. 63.6 of the 64.7 million parameters of the tier `paper` with six people
//! are in the decoder.
//!
//! HumanNeRF has one embedding for its single person. Here, people share the decoder and each
//! identity has its own embedding. The paper leaves this open; it is the smallest extension that
//! equals HumanNeRF for one person.

use crate::identity::blend::Blend;
use crate::init::Initial;
use burn::module::{Module, Param};
use burn::tensor::Tensor;
use burn::tensor::activation::leaky_relu;
use yoto_ops::deconv::{KERNEL, STRIDE, conv_transpose};

/// Slope of the activation below 0.
const SLOPE: f64 = 0.2;
/// Standard deviation of the initial embeddings.
const EMBEDDING_STD: f64 = 1.0;

/// Embeddings and the network that decodes them.
#[derive(Module, Debug)]
pub(crate) struct Decoder {
    /// One `[E]` per identity.
    embeddings: Vec<Param<Tensor<1>>>,
    /// `[E, H]`.
    linear: Param<Tensor<2>>,
    /// `[H]`.
    bias: Param<Tensor<1>>,
    /// `[in, out, 4, 4, 4]`, axes z, y, x.
    kernels: Vec<Param<Tensor<5>>>,
    /// `[out]`.
    biases: Vec<Param<Tensor<1>>>,
}

impl Decoder {
    /// Appends an identity that is a mixture of two others.
    pub(crate) fn append(&mut self, blend: &Blend) {
        blend.append(&mut self.embeddings);
    }

    /// A decoder with `widths` channels after its layers and `output` after the last one.
    pub(crate) fn new(
        init: &Initial,
        embedding: usize,
        hidden: usize,
        widths: &[usize],
        slots: usize,
        output: usize,
    ) -> Self {
        let outputs: Vec<usize> = widths.iter().copied().chain([output]).collect();
        let inputs = [hidden].into_iter().chain(widths.iter().copied());
        // Xavier-uniform with ReLU's gain √2.
        let bound = |fans: usize| 2f64.sqrt() * (6.0 / fans as f64).sqrt();
        let kernel = |(layer, (input, &output)): (usize, (usize, &usize))| {
            // An output node sees 2³ of the 4³ kernel nodes; all eight such phases start equal.
            init.phased(
                &format!("motion.decoder.kernels.{layer}"),
                [input, output, KERNEL, KERNEL, KERNEL],
                bound((input + output) * STRIDE.pow(3)),
                STRIDE.pow(3),
                phase_place,
            )
        };
        Self {
            embeddings: (0..slots)
                .map(|slot| {
                    init.normal(
                        &format!("motion.decoder.embeddings.{slot}"),
                        [embedding],
                        EMBEDDING_STD,
                    )
                })
                .collect(),
            linear: init.uniform(
                "motion.decoder.linear",
                [embedding, hidden],
                bound(embedding + hidden),
            ),
            bias: init.zeros("motion.decoder.bias", [hidden]),
            kernels: inputs.zip(&outputs).enumerate().map(kernel).collect(),
            biases: outputs
                .iter()
                .enumerate()
                .map(|(layer, &output)| {
                    init.zeros(&format!("motion.decoder.biases.{layer}"), [output])
                })
                .collect(),
        }
    }

    /// Logits `[K + 1, D³]` (z, y, x with x fastest) of the identity in `slot`.
    ///
    /// # Panics
    /// If there is no identity in `slot`.
    pub(crate) fn forward(&self, slot: usize) -> Tensor<2> {
        let embedding = self.embeddings[slot].val();
        let hidden =
            embedding.unsqueeze::<2>().matmul(self.linear.val()) + self.bias.val().unsqueeze::<2>();
        let [_, width] = hidden.dims();
        let mut volume = leaky_relu(hidden, SLOPE).reshape([width, 1, 1, 1]);
        let last = self.kernels.len() - 1;
        for (layer, (kernel, bias)) in self.kernels.iter().zip(&self.biases).enumerate() {
            let bias = bias.val().reshape([-1, 1, 1, 1]);
            volume = conv_transpose(volume, kernel.val()) + bias;
            if layer < last {
                volume = leaky_relu(volume, SLOPE);
            }
        }
        let [channels, z, y, x] = volume.dims();
        volume.reshape([channels, z * y * x])
    }
}

/// Index in `[in, out, 4, 4, 4]` of element `draw` of `[in, out, 2, 2, 2]` in `phase`.
fn phase_place(draw: usize, phase: usize) -> usize {
    let (kernel, node) = (draw / 8, draw % 8);
    let along = |shift: usize| STRIDE * (node >> shift & 1) + (phase >> shift & 1);
    ((kernel * KERNEL + along(2)) * KERNEL + along(1)) * KERNEL + along(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;

    #[test]
    fn every_node_of_a_kernel_is_drawn_once() {
        let mut positions: Vec<usize> = (0..16)
            .flat_map(|draw| (0..8).map(move |phase| phase_place(draw, phase)))
            .collect();
        positions.sort_unstable();
        assert_eq!(positions, (0..128).collect::<Vec<_>>());
    }

    #[test]
    fn a_fresh_decoder_has_no_checkerboard() {
        let device = Device::flex();
        let decoder = Decoder::new(&Initial::new(&device, 5), 8, 16, &[8, 4], 2, 3);
        let volume = decoder.forward(1);
        assert_eq!(volume.dims(), [3, 512]);
        let values: Vec<f32> = volume.try_into_vec_as().expect("f32");
        // Alike phases make the volume piecewise constant away from its border: the two middle
        // nodes along x agree.
        let at = |z: usize, y: usize, x: usize| values[(z * 8 + y) * 8 + x];
        assert!((at(3, 3, 3) - at(3, 3, 4)).abs() < 1e-5);
        let other = decoder.forward(0);
        let other: Vec<f32> = other.try_into_vec_as().expect("f32");
        assert_ne!(values, other, "each identity has its own");
    }
}
