//! The network: a layer, two residual blocks and a layer, with rectifiers between them.

use super::points::{BONE_COUNT, COUNT};
use super::window::INPUTS;
use faer::{Mat, MatRef};
use safetensors::tensor::{Dtype, TensorView};
use safetensors::{SafeTensorError, SafeTensors};
use thiserror::Error;

/// Values of a hidden layer.
pub const WIDTH: usize = 512;
/// Values that it returns: the depth of each point, then the logarithm of each bone's standard deviation.
pub const OUTPUTS: usize = COUNT + BONE_COUNT;
/// Names of the layers, with their inputs and outputs: `h = σ(A x)`, twice `h + C σ(B h)`, and `D h`.
pub const LAYERS: [(&str, usize, usize); 6] = [
    ("start", INPUTS, WIDTH),
    ("one_in", WIDTH, WIDTH),
    ("one_out", WIDTH, WIDTH),
    ("two_in", WIDTH, WIDTH),
    ("two_out", WIDTH, WIDTH),
    ("end", WIDTH, OUTPUTS),
];

/// Why a file has no network.
#[derive(Debug, Error)]
pub enum NetworkError {
    /// Not safetensors, or incomplete.
    #[error("not a network that finds depth: {0}")]
    Format(SafeTensorError),
    /// A tensor that is missing, or of another type or shape.
    #[error("{0}: the tensor is missing, or has another type or shape")]
    Tensor(String),
    /// A number that is not finite.
    #[error("{0}: a number is not finite")]
    Number(String),
}

/// A linear layer.
#[derive(Clone, Debug)]
pub struct Layer {
    /// `[inputs, outputs]`, row by row.
    pub weights: Vec<f32>,
    /// `[outputs]`.
    pub biases: Vec<f32>,
}

/// The weights of all [`LAYERS`], in their order.
#[derive(Clone, Debug)]
pub struct Network {
    layers: Vec<Layer>,
}

impl Network {
    /// The network of `layers`.
    ///
    /// # Errors
    /// [`NetworkError::Tensor`] for a layer of another shape, [`NetworkError::Number`] for a number that is not finite.
    pub fn new(layers: Vec<Layer>) -> Result<Self, NetworkError> {
        for (at, (name, inputs, outputs)) in LAYERS.into_iter().enumerate() {
            let layer = layers.get(at);
            let fits = |layer: &Layer| {
                layer.weights.len() == inputs * outputs && layer.biases.len() == outputs
            };
            let layer = layer.filter(|layer| fits(layer));
            let layer = layer.ok_or_else(|| NetworkError::Tensor(name.to_owned()))?;
            let mut numbers = layer.weights.iter().chain(&layer.biases);
            if !numbers.all(|number| number.is_finite()) {
                return Err(NetworkError::Number(name.to_owned()));
            }
        }
        Ok(Self { layers })
    }

    /// The network of a file.
    ///
    /// # Errors
    /// [`NetworkError`] for a file that has none.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, NetworkError> {
        let file = SafeTensors::deserialize(bytes).map_err(NetworkError::Format)?;
        let read = |name: String, shape: &[usize]| {
            let view = file.tensor(&name).ok();
            let view = view.filter(|it| it.dtype() == Dtype::BF16 && it.shape() == shape);
            let view = view.ok_or(NetworkError::Tensor(name))?;
            let numbers = view.data().as_chunks::<2>().0.iter();
            Ok(numbers.map(|it| unpacked(*it)).collect())
        };
        let layers = LAYERS.iter().map(|&(name, inputs, outputs)| {
            Ok(Layer {
                weights: read(format!("{name}.weights"), &[inputs, outputs])?,
                biases: read(format!("{name}.biases"), &[outputs])?,
            })
        });
        Self::new(layers.collect::<Result<_, _>>()?)
    }

    /// The network as a file. `notes` say where it comes from.
    ///
    /// # Errors
    /// [`NetworkError::Format`] if the format can't hold it.
    pub fn to_bytes(&self, notes: &[(String, String)]) -> Result<Vec<u8>, NetworkError> {
        let mut tensors: Vec<(String, Vec<usize>, Vec<u8>)> = Vec::new();
        for ((name, inputs, outputs), layer) in LAYERS.into_iter().zip(&self.layers) {
            let weights = layer.weights.iter().flat_map(|it| packed(*it)).collect();
            let biases = layer.biases.iter().flat_map(|it| packed(*it)).collect();
            tensors.push((format!("{name}.weights"), vec![inputs, outputs], weights));
            tensors.push((format!("{name}.biases"), vec![outputs], biases));
        }
        let views = tensors
            .iter()
            .map(|(name, shape, bytes)| {
                let view = TensorView::new(Dtype::BF16, shape.clone(), bytes);
                Ok((name.as_str(), view.map_err(NetworkError::Format)?))
            })
            .collect::<Result<Vec<_>, _>>()?;
        let notes = notes.iter().cloned().collect();
        safetensors::serialize(views, Some(notes)).map_err(NetworkError::Format)
    }

    /// The outputs `[N, OUTPUTS]` for the inputs `[N, INPUTS]`.
    pub fn run(&self, inputs: MatRef<'_, f32>) -> Mat<f32> {
        let through = |at: usize, values: MatRef<'_, f32>| {
            let (_, rows, columns) = LAYERS[at];
            let layer = &self.layers[at];
            let weights = MatRef::from_row_major_slice(&layer.weights, rows, columns);
            let mut values = values * weights;
            for (column, bias) in values.col_iter_mut().zip(&layer.biases) {
                column.iter_mut().for_each(|value| *value += bias);
            }
            values
        };
        let rectified = |mut values: Mat<f32>| {
            for column in values.col_iter_mut() {
                column.iter_mut().for_each(|value| *value = value.max(0.0));
            }
            values
        };
        let mut hidden = rectified(through(0, inputs));
        for block in [1, 3] {
            let inner = rectified(through(block, hidden.as_ref()));
            hidden += through(block + 1, inner.as_ref());
        }
        through(5, hidden.as_ref())
    }
}

/// The upper half of a number, rounded to the nearest: bfloat16.
fn packed(number: f32) -> [u8; 2] {
    let bits = number.to_bits();
    let rounded = bits.wrapping_add(0x7fff + ((bits >> 16) & 1));
    ((rounded >> 16) as u16).to_le_bytes()
}

fn unpacked(bytes: [u8; 2]) -> f32 {
    f32::from_bits(u32::from(u16::from_le_bytes(bytes)) << 16)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn network() -> Network {
        let layer = |(at, (_, inputs, outputs)): (usize, (&str, usize, usize))| Layer {
            weights: (0..inputs * outputs)
                .map(|i| ((i * 7 + at) % 11) as f32 / 128.0 - 0.04)
                .collect(),
            biases: (0..outputs).map(|i| (i % 5) as f32 / 8.0).collect(),
        };
        let layers = LAYERS.into_iter().enumerate().map(layer).collect();
        Network::new(layers).expect("shapes")
    }

    #[test]
    fn a_file_returns_the_network() {
        let network = network();
        let bytes = network.to_bytes(&[("licence".into(), "MIT".into())]);
        let read = Network::from_bytes(&bytes.expect("a file")).expect("a network");
        for (a, b) in network.layers.iter().zip(&read.layers) {
            let pairs = a.weights.iter().zip(&b.weights);
            assert!(
                pairs
                    .into_iter()
                    .all(|(a, b)| (a - b).abs() <= 0.004 * a.abs())
            );
        }
    }

    #[test]
    fn what_is_no_network_is_refused_by_name() {
        let bytes = network().to_bytes(&[]).expect("a file");
        assert!(matches!(
            Network::from_bytes(&bytes[..bytes.len() - 9]),
            Err(NetworkError::Format(_))
        ));
        let mut layers = network().layers;
        layers[2].biases.pop();
        let error = Network::new(layers).expect_err("a bias too few");
        assert!(error.to_string().starts_with("one_out"), "{error}");
        let mut layers = network().layers;
        layers[5].weights[0] = f32::NAN;
        let error = Network::new(layers).expect_err("not a number");
        assert_eq!(error.to_string(), "end: a number is not finite");
    }

    #[test]
    fn layers_are_applied_in_their_order() {
        let layer = |(_, inputs, outputs): (&str, usize, usize)| Layer {
            weights: vec![0.0; inputs * outputs],
            biases: vec![0.0; outputs],
        };
        let mut layers: Vec<Layer> = LAYERS.into_iter().map(layer).collect();
        let set = |layer: &mut Layer, value: f32, columns: usize| layer.weights[columns] = value;
        // Input 0 reaches the first hidden value, which a block doubles, and then the output 1.
        set(&mut layers[0], 3.0, 0);
        set(&mut layers[1], 1.0, 0);
        set(&mut layers[2], 1.0, 0);
        set(&mut layers[5], 0.5, 1);
        layers[5].biases[1] = 10.0;
        let network = Network::new(layers).expect("shapes");
        let input = |value: f32| Mat::from_fn(1, INPUTS, |_, j| if j == 0 { value } else { 0.0 });
        assert_eq!(network.run(input(2.0).as_ref())[(0, 1)], 16.0);
        assert_eq!(network.run(input(-2.0).as_ref())[(0, 1)], 10.0);
    }
}
