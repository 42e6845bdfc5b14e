//! A ReLU network in which one hidden layer receives the input again (skip connection) and some
//! layers receive a code that is the same for all points.
//!
//! Concatenating a constant code to `[N, in]` inputs is equivalent to adding its product with the
//! code's weights to the bias. The second form is used: it costs one small product per step
//! instead of `code` additional columns per point.

use crate::config::Precision;
use crate::init::Initial;
use burn::module::{Module, Param};
use burn::tensor::Tensor;
use yoto_ops::mlp::{Hidden, Input, MlpPlan, mlp};

/// Shape of a [`Mlp`].
pub(crate) struct MlpShape<'a> {
    /// Path of the network in the model, which names its tensors.
    pub path: &'a str,
    /// Width of the input.
    pub input: usize,
    /// Width of the hidden layers.
    pub width: usize,
    /// Hidden layers.
    pub depth: usize,
    /// Layer that receives the input again.
    pub skip: Option<usize>,
    /// Layers that receive a code, with the code's width.
    pub codes: &'a [(usize, usize)],
    /// Width of the output.
    pub output: usize,
    /// Initial output weights are uniform in ± this; if absent, in Xavier's bound.
    pub output_bound: Option<f64>,
    /// Precision of the factors of its products.
    pub precision: Precision,
}

/// A ReLU network with a skip connection and constant codes.
#[derive(Module, Debug)]
pub(crate) struct Mlp {
    hidden: Vec<Layer>,
    output: Layer,
    #[module(skip)]
    precision: Precision,
}

/// `x W + skip W_s + code W_c + b`.
#[derive(Module, Debug)]
struct Layer {
    /// `[in, out]`.
    weight: Param<Tensor<2>>,
    /// `[out]`.
    bias: Param<Tensor<1>>,
    /// `[input, out]`.
    skip: Option<Param<Tensor<2>>>,
    /// `[code, out]`.
    code: Option<Param<Tensor<2>>>,
}

impl Layer {
    fn new(
        init: &Initial,
        path: &str,
        input: usize,
        skip: usize,
        code: usize,
        output: usize,
        bound: Option<f64>,
    ) -> Self {
        // Xavier-uniform with ReLU's gain √2 (HumanNeRF), with all inputs of the layer
        // in the fan-in.
        let xavier = 2f64.sqrt() * (6.0 / (input + skip + code + output) as f64).sqrt();
        let weight = |part: &str, rows: usize| {
            init.uniform(
                &format!("{path}.{part}"),
                [rows, output],
                bound.unwrap_or(xavier),
            )
        };
        Self {
            weight: weight("weight", input),
            bias: init.zeros(&format!("{path}.bias"), [output]),
            skip: (skip > 0).then(|| weight("skip", skip)),
            code: (code > 0).then(|| weight("code", code)),
        }
    }

    /// Appends the layer's parameters in the order of [`MlpPlan`]; the contribution of the code
    /// is added to the bias.
    ///
    /// # Panics
    /// If there is a code without weights for it, or the reverse.
    fn append(&self, code: Option<Tensor<1>>, to: &mut Vec<Tensor<1>>) {
        let flat = |weight: &Param<Tensor<2>>| {
            let weight = weight.val();
            let [rows, columns] = weight.dims();
            weight.reshape([rows * columns])
        };
        let mut bias = self.bias.val();
        match (&self.code, code) {
            (Some(weight), Some(code)) => {
                let share = code.unsqueeze::<2>().matmul(weight.val());
                let [_, width] = share.dims();
                bias = bias + share.reshape([width]);
            }
            (None, None) => {}
            (Some(_), None) => panic!("a layer with weights for a code received none"),
            (None, Some(_)) => panic!("a layer without weights for a code received one"),
        }
        to.push(flat(&self.weight));
        to.extend(self.skip.as_ref().map(flat));
        to.push(bias);
    }
}

impl Mlp {
    /// Sets the precision of the factors of its products; the parameters stay unchanged.
    pub(crate) fn set_precision(&mut self, precision: Precision) {
        self.precision = precision;
    }

    /// A network with the initial weights that [`MlpShape`] describes and biases of 0.
    pub(crate) fn new(init: &Initial, shape: &MlpShape) -> Self {
        let code = |layer: usize| {
            shape
                .codes
                .iter()
                .find(|(at, _)| *at == layer)
                .map_or(0, |(_, width)| *width)
        };
        let hidden = (0..shape.depth)
            .map(|layer| {
                let input = if layer == 0 { shape.input } else { shape.width };
                let skip = if shape.skip == Some(layer) {
                    shape.input
                } else {
                    0
                };
                Layer::new(
                    init,
                    &format!("{}.{layer}", shape.path),
                    input,
                    skip,
                    code(layer),
                    shape.width,
                    None,
                )
            })
            .collect();
        let output = Layer::new(
            init,
            &format!("{}.output", shape.path),
            shape.width,
            0,
            0,
            shape.output,
            shape.output_bound,
        );
        Self {
            hidden,
            output,
            precision: shape.precision,
        }
    }

    /// `[N, kind.given()]` → `[N, output]`. `kind` describes `input` and must encode it in the
    /// network's input width. `codes` holds the code of each layer that takes one.
    pub(crate) fn forward(
        &self,
        input: Tensor<2>,
        kind: Input,
        codes: &[(usize, Tensor<1>)],
    ) -> Tensor<2> {
        let mut params = Vec::with_capacity(3 * (self.hidden.len() + 1));
        let mut hidden = Vec::with_capacity(self.hidden.len());
        for (at, layer) in self.hidden.iter().enumerate() {
            let code = codes
                .iter()
                .find(|(layer, _)| *layer == at)
                .map(|(_, code)| code.clone());
            layer.append(code, &mut params);
            hidden.push(Hidden {
                width: layer.bias.dims()[0],
                skip: layer.skip.is_some(),
            });
        }
        self.output.append(None, &mut params);
        let plan = MlpPlan {
            input: kind,
            hidden,
            output: self.output.bias.dims()[0],
            precision: self.precision,
        };
        mlp(Tensor::cat(params, 0), input, &plan)
    }
}
