//! The network in the form that is trained.

use burn::module::{Module, Param};
use burn::tensor::activation::relu;
use burn::tensor::{Device, Tensor, TensorData};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use yoto_pose::lift::network::{LAYERS, Layer, Network, NetworkError};
use yoto_pose::lift::{BONES, COUNT};

/// Range of the logarithm of a bone's standard deviation in metres: 1 cm to 1 m.
const LOG_RANGE: [f64; 2] = [-4.6, 0.0];

#[derive(Module, Debug)]
pub(super) struct LiftNet {
    layers: Vec<LinearLayer>,
}

#[derive(Module, Debug)]
struct LinearLayer {
    /// `[in, out]`.
    weights: Param<Tensor<2>>,
    /// `[out]`.
    biases: Param<Tensor<1>>,
}

impl LiftNet {
    /// A network with random weights: uniform by He for rectifiers, small where a block or the network ends.
    pub(super) fn new(seed: u64, device: &Device) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut layer = |(name, inputs, outputs): (&str, usize, usize)| {
            let is_end = name.ends_with("_out") || name == "end";
            let bound = (6.0 / inputs as f32).sqrt() * if is_end { 0.1 } else { 1.0 };
            let weights: Vec<f32> = (0..inputs * outputs)
                .map(|_| random.random_range(-bound..bound))
                .collect();
            let weights =
                Tensor::<2>::from_data(TensorData::new(weights, [inputs, outputs]), device);
            LinearLayer {
                weights: Param::from_tensor(weights),
                biases: Param::from_tensor(Tensor::<1>::zeros([outputs], device)),
            }
        };
        Self {
            layers: LAYERS.into_iter().map(&mut layer).collect(),
        }
    }

    fn run(&self, inputs: Tensor<2>) -> Tensor<2> {
        let through = |at: usize, values: Tensor<2>| {
            let layer = &self.layers[at];
            values.matmul(layer.weights.val()) + layer.biases.val().unsqueeze::<2>()
        };
        let mut hidden = relu(through(0, inputs));
        for block in [1, 3] {
            let inner = relu(through(block, hidden.clone()));
            hidden = hidden + through(block + 1, inner);
        }
        through(5, hidden)
    }

    /// The mean of √(1 + e² / σ²) + log σ over the bones' depths: −log p, but for a constant, of a distribution that is normal near its mean
    /// and has the tails of Laplace's, since a reading of a limb can be wrong by all of its length.
    pub(super) fn loss(&self, inputs: Tensor<2>, depths: Tensor<2>) -> Tensor<1> {
        let [count, _] = inputs.dims();
        let bones = bones(&inputs.device());
        let found = self.run(inputs);
        let off = (found.clone().slice([0..count, 0..COUNT]) - depths).matmul(bones);
        let logs = found.slice([0..count, COUNT..COUNT + BONES.len()]);
        let logs = logs.clamp(LOG_RANGE[0], LOG_RANGE[1]);
        let scaled = off * (-logs.clone()).exp();
        ((scaled.square() + 1.0).sqrt() + logs).mean()
    }

    /// The network as it is used.
    pub(super) fn network(&self) -> Result<Network, NetworkError> {
        let read = |layer: &LinearLayer| Layer {
            weights: layer
                .weights
                .val()
                .into_data()
                .try_to_vec()
                .unwrap_or_default(),
            biases: layer
                .biases
                .val()
                .into_data()
                .try_to_vec()
                .unwrap_or_default(),
        };
        Network::new(self.layers.iter().map(read).collect())
    }
}

/// The matrix from depths of points to those of bones, `[COUNT, BONES]`.
fn bones(device: &Device) -> Tensor<2> {
    let mut matrix = vec![0f32; COUNT * BONES.len()];
    for (bone, [from, to]) in BONES.into_iter().enumerate() {
        matrix[from * BONES.len() + bone] -= 1.0;
        matrix[to * BONES.len() + bone] += 1.0;
    }
    Tensor::from_data(TensorData::new(matrix, [COUNT, BONES.len()]), device)
}
