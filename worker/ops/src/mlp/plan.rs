//! The shape of a network, and the order of its parameters.

use crate::Precision;
use crate::encode::Bands;

/// The input of a network.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// Features `[N, width]`, used as they are.
    Features {
        /// Numbers per row.
        width: usize,
    },
    /// Points `[N, 3]`, metres, encoded as [`crate::encode::frequencies`] does.
    Frequencies {
        /// Bands of the encoding.
        bands: Bands,
        /// Whether the input has the point itself before its encoding.
        raw: bool,
    },
}

impl Input {
    /// Numbers per row of the first layer's input.
    pub fn width(&self) -> usize {
        match self {
            Self::Features { width } => *width,
            Self::Frequencies { bands, raw } => 6 * bands.count + if *raw { 3 } else { 0 },
        }
    }

    /// Numbers per row of the operation's input, before the encoding.
    pub fn given(&self) -> usize {
        match self {
            Self::Features { width } => *width,
            Self::Frequencies { .. } => 3,
        }
    }
}

/// A hidden layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hidden {
    /// Width of its result.
    pub width: usize,
    /// Whether its input is the result of the layer before, concatenated with the network's input.
    pub skip: bool,
}

/// A network: hidden layers with ReLU, and a linear layer.
#[derive(Clone, Debug, PartialEq)]
pub struct MlpPlan {
    /// Input of the network.
    pub input: Input,
    /// Hidden layers.
    pub hidden: Vec<Hidden>,
    /// Width of the result.
    pub output: usize,
    /// Precision that factors of products are rounded to.
    pub precision: Precision,
}

/// A part of a layer's weight.
pub struct Part {
    /// Whether it is multiplied with the network's input; otherwise with the result of the layer before.
    pub input: bool,
    /// Rows.
    pub width: usize,
    /// Index of its first number in the flat parameters, which hold it row by row.
    pub weight: usize,
}

/// Position of a layer in the flat parameters.
pub struct LayerShape {
    /// Parts of the weight, each `[width, columns]`.
    pub parts: Vec<Part>,
    /// Width of the result.
    pub columns: usize,
    /// Index of the first number of the bias `[columns]` in the flat parameters.
    pub bias: usize,
}

impl MlpPlan {
    /// The layers, the linear one last. The flat parameters hold, layer by layer, the weight
    /// for the layer before, the weight for the input where there is a skip, and the bias.
    pub fn layers(&self) -> Vec<LayerShape> {
        let mut at = 0;
        let mut before = self.input.width();
        let last = Hidden {
            width: self.output,
            skip: false,
        };
        let mut layers = Vec::with_capacity(self.hidden.len() + 1);
        for (l, layer) in self.hidden.iter().chain([&last]).enumerate() {
            let columns = layer.width;
            let mut parts = Vec::with_capacity(2);
            let mut part = |input, width| {
                parts.push(Part {
                    input,
                    width,
                    weight: at,
                });
                at += width * columns;
            };
            part(l == 0, before);
            if layer.skip {
                part(true, self.input.width());
            }
            layers.push(LayerShape {
                parts,
                columns,
                bias: at,
            });
            at += columns;
            before = columns;
        }
        layers
    }

    /// Numbers of the flat parameters.
    pub fn parameters(&self) -> usize {
        self.layers()
            .last()
            .map_or(0, |layer| layer.bias + layer.columns)
    }

    /// Multiply-adds per row of the forward pass.
    pub fn products(&self) -> usize {
        self.layers()
            .iter()
            .flat_map(|layer| layer.parts.iter().map(|part| part.width * layer.columns))
            .sum()
    }
}
