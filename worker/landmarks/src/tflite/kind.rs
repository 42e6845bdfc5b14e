//! Operators and their options.

use super::bytes::Table;

/// The kinds of operators.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum OperatorKind {
    Add(Activation),
    Concatenation {
        axis: i32,
    },
    Conv(Window, Activation),
    DepthwiseConv(Window, Activation),
    DepthToSpace {
        block: usize,
    },
    FullyConnected(Activation),
    Logistic,
    MaxPool {
        window: Window,
        filter: [usize; 2],
    },
    Mean {
        keeps_axes: bool,
    },
    Pad,
    /// `max(x, 0) + slope min(x, 0)`, with a slope for each channel.
    Prelu,
    Reshape,
    ResizeBilinear {
        half_pixels: bool,
    },
    /// Conversion of 16-bit or sparse weights, which is done while reading.
    Unpack,
}

/// The movement of a filter over a picture. Pairs are (rows, columns).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Window {
    pub(crate) padding: Padding,
    pub(crate) stride: [usize; 2],
    pub(crate) dilation: [usize; 2],
}

/// The padding at the border of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Padding {
    /// Zeros, so that the output has one pixel per stride.
    Same,
    /// None: the filter stays inside the picture.
    Valid,
}

/// The activation function of an operator's output.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Activation {
    #[default]
    None,
    /// `max(x, 0)`.
    Relu,
    /// `min(max(x, 0), 6)`.
    Relu6,
}

impl Activation {
    /// The range to which values are clamped.
    pub(crate) fn range(self) -> [f32; 2] {
        match self {
            Self::None => [f32::NEG_INFINITY, f32::INFINITY],
            Self::Relu => [0.0, f32::INFINITY],
            Self::Relu6 => [0.0, 6.0],
        }
    }

    fn read(options: Option<Table>, field: usize) -> Result<Self, String> {
        match options.and_then(|table| table.u8(field)).unwrap_or(0) {
            0 => Ok(Self::None),
            1 => Ok(Self::Relu),
            3 => Ok(Self::Relu6),
            other => Err(format!("activation {other} is not supported")),
        }
    }
}

/// Names of the first operators of the format, by their codes.
const NAMES: [&str; 60] = [
    "ADD",
    "AVERAGE_POOL_2D",
    "CONCATENATION",
    "CONV_2D",
    "DEPTHWISE_CONV_2D",
    "DEPTH_TO_SPACE",
    "DEQUANTIZE",
    "EMBEDDING_LOOKUP",
    "FLOOR",
    "FULLY_CONNECTED",
    "HASHTABLE_LOOKUP",
    "L2_NORMALIZATION",
    "L2_POOL_2D",
    "LOCAL_RESPONSE_NORMALIZATION",
    "LOGISTIC",
    "LSH_PROJECTION",
    "LSTM",
    "MAX_POOL_2D",
    "MUL",
    "RELU",
    "RELU_N1_TO_1",
    "RELU6",
    "RESHAPE",
    "RESIZE_BILINEAR",
    "RNN",
    "SOFTMAX",
    "SPACE_TO_DEPTH",
    "SVDF",
    "TANH",
    "CONCAT_EMBEDDINGS",
    "SKIP_GRAM",
    "CALL",
    "CUSTOM",
    "EMBEDDING_LOOKUP_SPARSE",
    "PAD",
    "UNIDIRECTIONAL_SEQUENCE_RNN",
    "GATHER",
    "BATCH_TO_SPACE_ND",
    "SPACE_TO_BATCH_ND",
    "TRANSPOSE",
    "MEAN",
    "SUB",
    "DIV",
    "SQUEEZE",
    "UNIDIRECTIONAL_SEQUENCE_LSTM",
    "STRIDED_SLICE",
    "BIDIRECTIONAL_SEQUENCE_RNN",
    "EXP",
    "TOPK_V2",
    "SPLIT",
    "LOG_SOFTMAX",
    "DELEGATE",
    "BIDIRECTIONAL_SEQUENCE_LSTM",
    "CAST",
    "PRELU",
    "MAXIMUM",
    "ARG_MAX",
    "MINIMUM",
    "LESS",
    "NEG",
];

/// The operator of `code` with its options.
pub(super) fn read(code: i32, options: Option<Table>) -> Result<OperatorKind, String> {
    let size = |field: usize, default: i32| {
        let value = options.and_then(|table| table.i32(field));
        match value.unwrap_or(default) {
            value @ 1..=64 => Ok(value as usize),
            other => Err(format!("option {field} of operator {code} is {other}")),
        }
    };
    let flag = |field| options.and_then(|table| table.u8(field)) == Some(1);
    let window = |dilation: Option<usize>| {
        Ok::<_, String>(Window {
            padding: match options.and_then(|table| table.u8(0)).unwrap_or(0) {
                0 => Padding::Same,
                _ => Padding::Valid,
            },
            stride: [size(2, 0)?, size(1, 0)?],
            dilation: match dilation {
                Some(field) => [size(field + 1, 1)?, size(field, 1)?],
                None => [1, 1],
            },
        })
    };
    Ok(match code {
        0 => OperatorKind::Add(Activation::read(options, 0)?),
        2 if Activation::read(options, 1)? == Activation::None => OperatorKind::Concatenation {
            axis: options.and_then(|table| table.i32(0)).unwrap_or(0),
        },
        3 => OperatorKind::Conv(window(Some(4))?, Activation::read(options, 3)?),
        4 => OperatorKind::DepthwiseConv(window(Some(5))?, Activation::read(options, 4)?),
        5 => OperatorKind::DepthToSpace { block: size(0, 0)? },
        6 | 124 => OperatorKind::Unpack,
        9 => OperatorKind::FullyConnected(Activation::read(options, 0)?),
        14 => OperatorKind::Logistic,
        17 if Activation::read(options, 5)? == Activation::None => OperatorKind::MaxPool {
            window: window(None)?,
            filter: [size(4, 0)?, size(3, 0)?],
        },
        22 => OperatorKind::Reshape,
        23 if !flag(2) => OperatorKind::ResizeBilinear {
            half_pixels: flag(3),
        },
        34 => OperatorKind::Pad,
        40 => OperatorKind::Mean {
            keeps_axes: flag(0),
        },
        54 => OperatorKind::Prelu,
        _ => {
            let name = usize::try_from(code).ok().and_then(|code| NAMES.get(code));
            return Err(match name {
                Some(name) => format!("the operator {name} with its options is not supported"),
                None => format!("the operator of code {code} is not supported"),
            });
        }
    })
}
