//! The shape of a network as the operation sees it.

use crate::config::Precision;
use crate::ops::encode::Bands;

/// What comes into the network.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// `[N, width]`, as they are.
    Features {
        /// Numbers a row.
        width: usize,
    },
    /// Points `[N, 3]`, metres, encoded as [`crate::ops::encode::frequencies`] does.
    Frequencies {
        /// Of the encoding.
        bands: Bands,
        /// Whether the point itself comes first.
        raw: bool,
    },
}

impl Input {
    /// Numbers a row that the first layer sees.
    pub fn width(&self) -> usize {
        match self {
            Self::Features { width } => *width,
            Self::Frequencies { bands, raw } => 6 * bands.count + if *raw { 3 } else { 0 },
        }
    }

    /// Numbers a row that the operation gets.
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
    /// Whether it gets the network's input beside the layer before.
    pub skip: bool,
}

/// A network: hidden layers with ReLU, and a linear one.
#[derive(Clone, Debug, PartialEq)]
pub struct MlpPlan {
    /// What comes in.
    pub input: Input,
    /// Hidden layers.
    pub hidden: Vec<Hidden>,
    /// Width of the result.
    pub output: usize,
    /// What factors of products are rounded to.
    pub precision: Precision,
}

/// A part of a layer's weight.
pub struct Part {
    /// Whether it multiplies the network's input, and not the layer before.
    pub input: bool,
    /// Rows.
    pub width: usize,
    /// First number in the flat parameters, where it stands row by row.
    pub weight: usize,
}

/// A layer's place in the flat parameters.
pub struct LayerShape {
    /// Parts of the weight, each `[width, columns]`.
    pub parts: Vec<Part>,
    /// Width of the result.
    pub columns: usize,
    /// First number of the bias `[columns]` in the flat parameters.
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

    /// Multiply-adds a row, forward.
    pub fn products(&self) -> usize {
        self.layers()
            .iter()
            .flat_map(|layer| layer.parts.iter().map(|part| part.width * layer.columns))
            .sum()
    }
}
