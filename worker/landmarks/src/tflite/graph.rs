//! Tensors and operators of a model.

use super::bytes::{Table, Vector};
use super::constants::{Budget, Constant};
use super::kind::{self, OperatorKind};

/// Most tensors or operators of a model.
const MAX_PARTS: usize = 1 << 14;

/// A model: operators in the order in which they run.
#[derive(Debug)]
pub(crate) struct Graph {
    /// Tensors with their shapes, and with values for weights.
    pub(crate) tensors: Vec<Tensor>,
    pub(crate) operators: Vec<Operator>,
    /// Input tensors.
    pub(crate) inputs: Vec<usize>,
    /// Output tensors.
    pub(crate) outputs: Vec<usize>,
}

/// A tensor of a model, `[1, height, width, channels]` if it is a picture.
#[derive(Debug)]
pub(crate) struct Tensor {
    /// Shape in the file.
    pub(crate) shape: Vec<usize>,
    /// The values of a constant.
    pub(crate) constant: Option<Constant>,
}

/// A step of a model. Every index is a tensor's index in the graph.
#[derive(Debug)]
pub(crate) struct Operator {
    pub(crate) kind: OperatorKind,
    pub(crate) inputs: Vec<usize>,
    pub(crate) output: usize,
}

impl Graph {
    /// Reads the first graph of a model's file.
    ///
    /// Weights that operators unpack are read as constants, so no [`OperatorKind::Unpack`] remains.
    ///
    /// # Errors
    /// A message for people: no model, an unsupported operator or kind of weights, or offsets outside the file.
    pub(crate) fn read(bytes: &[u8]) -> Result<Self, String> {
        if bytes.get(4..8) != Some(b"TFL3") {
            return Err("is not a TensorFlow Lite model".into());
        }
        let cut = || "is damaged or cut short".to_owned();
        let root = Table::root(bytes).ok_or_else(cut)?;
        let codes = vector(root, 1)?;
        let buffers = vector(root, 4)?;
        let graph = vector(root, 2)?.table(0).ok_or_else(cut)?;
        let mut budget = Budget::new();
        let mut tensors: Vec<Tensor> = Vec::new();
        for (at, table) in tables(graph, 0)?.into_iter().enumerate() {
            let tensor = read_tensor(table, buffers, &mut budget);
            tensors.push(tensor.map_err(|message| format!("tensor {at}: {message}"))?);
        }
        let known = |at: i32| {
            let at = usize::try_from(at).ok().filter(|at| *at < tensors.len());
            at.ok_or_else(|| "an operator names a tensor that is not there".to_owned())
        };
        // The tensor with each tensor's values: for unpacked weights, the packed tensor.
        let mut at_source: Vec<usize> = (0..tensors.len()).collect();
        let mut operators = Vec::new();
        for (at, table) in tables(graph, 3)?.into_iter().enumerate() {
            let code = table.u32(0).unwrap_or(0) as usize;
            let code = codes.table(code).ok_or_else(cut)?;
            // The first field has one byte; codes above 126 are in a field of their own.
            let code = i32::from(code.u8(0).unwrap_or(0)).max(code.i32(3).unwrap_or(0));
            let kind = kind::read(code, table.table(4))
                .map_err(|message| format!("operator {at}: {message}"))?;
            let inputs = table.i32s(1)?.into_iter().filter(|&at| at >= 0);
            let inputs = inputs.map(|at| Ok(at_source[known(at)?]));
            let inputs = inputs.collect::<Result<Vec<_>, String>>()?;
            let [output] = table.i32s(2)?[..] else {
                return Err(format!("operator {at}: one output is needed"));
            };
            let output = known(output)?;
            if kind != OperatorKind::Unpack {
                operators.push(Operator {
                    kind,
                    inputs,
                    output,
                });
                continue;
            }
            match inputs[..] {
                [packed] if tensors[packed].constant.is_some() => at_source[output] = packed,
                _ => return Err(format!("operator {at}: unpacks what is not a constant")),
            }
        }
        let ends = |field| graph.i32s(field)?.into_iter().map(known).collect();
        let (inputs, outputs): (Result<_, _>, Result<_, _>) = (ends(1), ends(2));
        let (inputs, outputs) = (inputs?, outputs?);
        Ok(Self {
            tensors,
            operators,
            inputs,
            outputs,
        })
    }
}

/// A vector of tables, after a check of its length.
fn vector(table: Table<'_>, field: usize) -> Result<Vector<'_>, String> {
    let vector = table.vector(field, 4).ok_or("is damaged or cut short")?;
    if vector.len() > MAX_PARTS {
        return Err(format!("{} parts: at most {MAX_PARTS}", vector.len()));
    }
    Ok(vector)
}

fn tables(table: Table<'_>, field: usize) -> Result<Vec<Table<'_>>, String> {
    let all = vector(table, field)?.tables().collect::<Option<_>>();
    all.ok_or_else(|| "is damaged or cut short".into())
}

fn read_tensor(table: Table, buffers: Vector, budget: &mut Budget) -> Result<Tensor, String> {
    let shape = table.i32s(0)?.into_iter().map(usize::try_from);
    let shape = shape.collect::<Result<Vec<_>, _>>();
    let shape = shape.map_err(|_| "a side is negative")?;
    let buffer = table.u32(2).unwrap_or(0) as usize;
    let buffer = buffers.table(buffer).ok_or("its buffer is not there")?;
    let data = buffer.vector(0, 1).map(|data| data.raw());
    let data = data.unwrap_or_default();
    let constant = match data {
        [] => None,
        data => Some(budget.read(table, &shape, data)?),
    };
    Ok(Tensor { shape, constant })
}
