//! Writes small models for tests.

/// A part of a flatbuffer.
#[derive(Clone, Debug)]
pub(crate) enum Node {
    Absent,
    U8(u8),
    I32(i32),
    Table(Vec<Node>),
    Bytes(Vec<u8>),
    Ints(Vec<i32>),
    Tables(Vec<Node>),
}

/// A tensor: shape, type, bytes if it is constant, sparsity.
#[derive(Clone, Debug)]
pub(crate) struct Values(
    pub(crate) Vec<i32>,
    pub(crate) u8,
    pub(crate) Vec<u8>,
    pub(crate) Node,
);

/// An operator: code, options, inputs, output.
#[derive(Clone, Debug)]
pub(crate) struct Does(
    pub(crate) i32,
    pub(crate) Node,
    pub(crate) Vec<i32>,
    pub(crate) i32,
);

/// A tensor that is computed.
pub(crate) fn computed(shape: &[i32]) -> Values {
    Values(shape.to_vec(), 0, Vec::new(), Node::Absent)
}

/// A constant tensor of 32-bit floats.
pub(crate) fn floats(shape: &[i32], values: &[f32]) -> Values {
    let bytes = values.iter().flat_map(|value| value.to_le_bytes());
    Values(shape.to_vec(), 0, bytes.collect(), Node::Absent)
}

/// A constant tensor of 32-bit integers.
pub(crate) fn ints(shape: &[i32], values: &[i32]) -> Values {
    let bytes = values.iter().flat_map(|value| value.to_le_bytes());
    Values(shape.to_vec(), 2, bytes.collect(), Node::Absent)
}

/// The file of a model with the first tensor as input and the last as output.
pub(crate) fn model(tensors: &[Values], operators: &[Does]) -> Vec<u8> {
    let buffers = tensors
        .iter()
        .map(|values| Node::Table(vec![Node::Bytes(values.2.clone())]));
    let tensor = |(buffer, values): (i32, &Values)| {
        Node::Table(vec![
            Node::Ints(values.0.clone()),
            Node::U8(values.1),
            Node::I32(buffer),
            Node::Absent,
            Node::Absent,
            Node::Absent,
            values.3.clone(),
        ])
    };
    let operator = |(code, does): (i32, &Does)| {
        Node::Table(vec![
            Node::I32(code),
            Node::Ints(does.2.clone()),
            Node::Ints(vec![does.3]),
            Node::U8(0),
            does.1.clone(),
        ])
    };
    let code = |does: &Does| {
        let old = Node::U8(does.0.min(127) as u8);
        Node::Table(vec![old, Node::Absent, Node::Absent, Node::I32(does.0)])
    };
    let graph = Node::Table(vec![
        Node::Tables((0..).zip(tensors).map(tensor).collect()),
        Node::Ints(vec![0]),
        Node::Ints(vec![tensors.len() as i32 - 1]),
        Node::Tables((0..).zip(operators).map(operator).collect()),
    ]);
    let root = Node::Table(vec![
        Node::I32(3),
        Node::Tables(operators.iter().map(code).collect()),
        Node::Tables(vec![graph]),
        Node::Absent,
        Node::Tables(buffers.collect()),
    ]);
    let mut out = b"\0\0\0\0TFL3".to_vec();
    let at = write(&mut out, &root);
    patch(&mut out, 0, at);
    out
}

/// Points the offset at `from` to `to`.
fn patch(out: &mut [u8], from: usize, to: usize) {
    out[from..from + 4].copy_from_slice(&((to - from) as u32).to_le_bytes());
}

/// Appends `node` and returns its offset.
fn write(out: &mut Vec<u8>, node: &Node) -> usize {
    let at = out.len();
    match node {
        Node::Table(fields) => {
            out.extend((4 + 2 * fields.len() as u16).to_le_bytes());
            out.extend((4 + 4 * fields.len() as u16).to_le_bytes());
            for (slot, field) in (1..).zip(fields) {
                let absent = matches!(field, Node::Absent);
                out.extend((if absent { 0u16 } else { 4 * slot }).to_le_bytes());
            }
            let table = out.len();
            out.extend(((table - at) as i32).to_le_bytes());
            for field in fields {
                let value = match field {
                    Node::U8(value) => i32::from(*value),
                    Node::I32(value) => *value,
                    _ => 0,
                };
                out.extend(value.to_le_bytes());
            }
            for (slot, field) in (1..).zip(fields) {
                if !matches!(field, Node::Absent | Node::U8(_) | Node::I32(_)) {
                    let to = write(out, field);
                    patch(out, table + 4 * slot, to);
                }
            }
            return table;
        }
        Node::Bytes(bytes) => {
            out.extend((bytes.len() as u32).to_le_bytes());
            out.extend(bytes);
        }
        Node::Ints(ints) => {
            out.extend((ints.len() as u32).to_le_bytes());
            out.extend(ints.iter().flat_map(|value| value.to_le_bytes()));
        }
        Node::Tables(tables) => {
            out.extend((tables.len() as u32).to_le_bytes());
            out.extend(vec![0; 4 * tables.len()]);
            for (slot, table) in tables.iter().enumerate() {
                let to = write(out, table);
                patch(out, at + 4 + 4 * slot, to);
            }
        }
        Node::Absent | Node::U8(_) | Node::I32(_) => (),
    }
    at
}
