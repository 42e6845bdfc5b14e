//! Tiny networks as ONNX files, in the forms of public matting models, for which bright pixels are the person.

use rten_onnx::onnx::{
    AttributeProto, AttributeType, DataType, Dimension, GraphProto, ModelProto, NodeProto,
    OperatorSetIdProto, TensorProto, TensorShapeProto, TypeProto, TypeProtoTensor, ValueInfoProto,
};
use std::path::Path;

/// A network under construction.
#[derive(Default)]
pub(crate) struct Network {
    graph: GraphProto,
}

/// An input or output with its dimensions; 0 leaves one open.
fn value(name: &str, shape: &[i64]) -> ValueInfoProto {
    let dimension = |(at, &size): (usize, &i64)| Dimension {
        dim_value: (size > 0).then_some(size),
        dim_param: (size == 0).then(|| format!("{name}_{at}")),
    };
    let tensor = TypeProtoTensor {
        elem_type: Some(DataType::FLOAT),
        shape: Some(TensorShapeProto {
            dim: shape.iter().enumerate().map(dimension).collect(),
        }),
    };
    ValueInfoProto {
        name: Some(name.into()),
        r#type: Some(TypeProto {
            tensor_type: Some(tensor),
            ..TypeProto::default()
        }),
    }
}

impl Network {
    pub(crate) fn input(mut self, name: &str, shape: &[i64]) -> Self {
        self.graph.input.push(value(name, shape));
        self
    }

    pub(crate) fn output(mut self, name: &str, shape: &[i64]) -> Self {
        self.graph.output.push(value(name, shape));
        self
    }

    pub(crate) fn constant(mut self, name: &str, number: f32) -> Self {
        self.graph.initializer.push(TensorProto {
            name: Some(name.into()),
            dims: vec![1],
            data_type: Some(DataType::FLOAT),
            float_data: vec![number],
            ..TensorProto::default()
        });
        self
    }

    pub(crate) fn node(mut self, kind: &str, inputs: &[&str], output: &str) -> Self {
        self.graph.node.push(NodeProto {
            op_type: Some(kind.into()),
            name: Some(format!("{kind} of {output}")),
            input: inputs.iter().map(|it| (*it).to_owned()).collect(),
            output: vec![output.into()],
            ..NodeProto::default()
        });
        self
    }

    /// Gives the last node a list of whole numbers.
    pub(crate) fn with(mut self, name: &str, numbers: &[i64]) -> Self {
        if let Some(node) = self.graph.node.last_mut() {
            node.attribute.push(AttributeProto {
                name: Some(name.into()),
                ints: numbers.to_vec(),
                r#type: Some(AttributeType::INTS),
                ..AttributeProto::default()
            });
        }
        self
    }

    pub(crate) fn bytes(self) -> Vec<u8> {
        let model = ModelProto {
            ir_version: Some(8),
            graph: Some(self.graph),
            opset_import: vec![OperatorSetIdProto {
                domain: None,
                version: Some(13),
            }],
            ..ModelProto::default()
        };
        model.write_buf().expect("a network as bytes")
    }

    pub(crate) fn write(self, path: &Path) {
        std::fs::write(path, self.bytes()).expect("a file");
    }
}

/// Takes levels from -1 to 1, as MODNet does, of pictures `[1, 3, rows, columns]` (0: of any size): the
/// brightest channel becomes coverage, 0 up to the level 32 of 255 and 1 from 45 on.
pub(crate) fn bright(rows: i64, columns: i64) -> Network {
    Network::default()
        .input("input", &[1, 3, rows, columns])
        .constant("steep", 10.0)
        .constant("dark", 7.5)
        .constant("none", 0.0)
        .constant("all", 1.0)
        .node("ReduceMax", &["input"], "brightest")
        .with("axes", &[1])
        .node("Mul", &["brightest", "steep"], "steeper")
        .node("Add", &["steeper", "dark"], "levels")
        .node("Max", &["levels", "none"], "floor")
        .node("Min", &["floor", "all"], "output")
        .output("output", &[1, 1, rows, columns])
}
