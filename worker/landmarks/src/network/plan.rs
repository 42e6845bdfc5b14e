//! Turns a graph into steps. Sizes are computed and checked, and values that are not needed at the same time share a
//! buffer.

use super::{Made, Network, Step, conv, depthwise, pointwise, pool, resize, shapes};
use crate::tflite::{Constant, Graph, Operator, OperatorKind};

/// Most numbers that all buffers may hold: 256 MiB of them.
const MAX_NUMBERS: usize = 1 << 26;

/// Buffers, with the step up to which each one's value is needed.
#[derive(Default)]
struct Buffers {
    lengths: Vec<usize>,
    needed_until: Vec<usize>,
}

impl Buffers {
    /// A buffer for `len` numbers that `step` writes, and that are needed until step `until`.
    fn take(&mut self, len: usize, step: usize, until: usize) -> usize {
        let free = |at: &usize| self.needed_until[*at] < step;
        // The best fit: the smallest buffer that is large enough, or else the largest.
        let best = (0..self.lengths.len()).filter(free).min_by_key(|&at| {
            let length = self.lengths[at];
            (length < len, length.abs_diff(len))
        });
        let at = best.unwrap_or_else(|| {
            self.lengths.push(0);
            self.needed_until.push(0);
            self.lengths.len() - 1
        });
        self.lengths[at] = self.lengths[at].max(len);
        self.needed_until[at] = until;
        at
    }
}

/// The network that computes `graph`.
pub(super) fn plan(mut graph: Graph) -> Result<Network, String> {
    let [input] = graph.inputs[..] else {
        return Err(format!("{} inputs: one is needed", graph.inputs.len()));
    };
    let mut last_use = vec![0; graph.tensors.len()];
    for (step, operator) in graph.operators.iter().enumerate() {
        for &at in &operator.inputs {
            last_use[at] = step + 1;
        }
    }
    for &at in &graph.outputs {
        last_use[at] = usize::MAX;
    }
    let mut buffers = Buffers::default();
    // Shape and buffer of each value that has been computed.
    let mut values: Vec<Option<(Vec<usize>, usize)>> = vec![None; graph.tensors.len()];
    let shape = graph.tensors[input].shape.clone();
    let len = length(&shape)?;
    // The input keeps its buffer: callers fill it before each run.
    let buffer = buffers.take(len, 1, usize::MAX);
    values[input] = Some((shape, buffer));
    let input = (buffer, len);
    let mut steps = Vec::new();
    let mut weights = 0;
    for (at, operator) in std::mem::take(&mut graph.operators).iter().enumerate() {
        let step = at + 1;
        let fault = |message| format!("operator {at} ({:?}): {message}", operator.kind);
        let given: Vec<&(Vec<usize>, usize)> = operator
            .inputs
            .iter()
            .filter_map(|&at| values[at].as_ref())
            .collect();
        // Each step copies its weights, so weights that several steps share count each time: otherwise a small file
        // could fill the memory.
        let constants = operator
            .inputs
            .iter()
            .map(|&at| match &graph.tensors[at].constant {
                Some(Constant::Floats(values)) => values.len(),
                _ => 0,
            });
        weights += constants.sum::<usize>();
        if weights > MAX_NUMBERS {
            return Err(fault(format!("more than {MAX_NUMBERS} weights")));
        }
        let (operation, shape) = make(operator, &given, &graph).map_err(fault)?;
        let mut inputs = Vec::new();
        for (shape, buffer) in given {
            inputs.push((*buffer, length(shape)?));
        }
        let len = length(&shape).map_err(fault)?;
        let buffer = buffers.take(len, step, last_use[operator.output].max(step));
        if buffers.lengths.iter().sum::<usize>() > MAX_NUMBERS {
            return Err(fault(format!("more than {MAX_NUMBERS} numbers at a time")));
        }
        values[operator.output] = Some((shape, buffer));
        let output = (buffer, len);
        steps.push(Step {
            operation,
            inputs,
            output,
        });
    }
    let outputs = graph.outputs.iter().map(|&at| values[at].clone());
    let outputs = outputs.collect::<Option<_>>();
    Ok(Network {
        steps,
        buffers: buffers.lengths.iter().map(|&len| vec![0.0; len]).collect(),
        input,
        outputs: outputs.ok_or("an output is never computed")?,
    })
}

fn length(shape: &[usize]) -> Result<usize, String> {
    let len = shape.iter().try_fold(1usize, |a, &b| a.checked_mul(b));
    len.filter(|len| (1..=MAX_NUMBERS).contains(len))
        .ok_or_else(|| format!("the shape {shape:?} is not possible"))
}

/// The operation of `operator` for values with the shapes `given`; all other inputs are constants.
fn make(
    operator: &Operator,
    given: &[&(Vec<usize>, usize)],
    graph: &Graph,
) -> Result<Made, String> {
    let shape = |at: usize| given.get(at).map(|(shape, _)| &shape[..]);
    let first = shape(0).ok_or("no input is computed before it")?;
    let constant = |at: usize| {
        let tensor = operator
            .inputs
            .get(at)
            .and_then(|&at| graph.tensors.get(at));
        tensor.and_then(|tensor| Some((&tensor.shape[..], tensor.constant.as_ref()?)))
    };
    let floats = |at: usize| match constant(at) {
        Some((shape, Constant::Floats(values))) => Ok((shape, &values[..])),
        _ => Err(format!("input {at} is not constant floats")),
    };
    let ints = |at: usize| match constant(at) {
        Some((_, Constant::Ints(values))) => Ok(&values[..]),
        _ => Err(format!("input {at} is not constant integers")),
    };
    let computed = |count: usize| {
        if given.len() == count && operator.inputs.len() >= count {
            return Ok(());
        }
        Err(format!("{} computed inputs, {count} expected", given.len()))
    };
    if !matches!(
        operator.kind,
        OperatorKind::Add(_) | OperatorKind::Concatenation { .. }
    ) {
        computed(1)?;
    }
    match operator.kind {
        OperatorKind::Add(activation) => {
            computed(2)?;
            pointwise::add(first, shape(1).unwrap_or_default(), activation)
        }
        OperatorKind::Concatenation { axis } => {
            computed(operator.inputs.len())?;
            let shapes: Vec<&[usize]> = given.iter().map(|(shape, _)| &shape[..]).collect();
            shapes::concatenation(&shapes, axis)
        }
        OperatorKind::Conv(window, activation) => {
            conv::conv(first, floats(1)?, floats(2)?.1, window, activation)
        }
        OperatorKind::DepthwiseConv(window, activation) => {
            depthwise::depthwise(first, floats(1)?, floats(2)?.1, window, activation)
        }
        OperatorKind::DepthToSpace { block } => shapes::depth_to_space(first, block),
        OperatorKind::FullyConnected(activation) => {
            conv::fully_connected(first, floats(1)?, floats(2)?.1, activation)
        }
        OperatorKind::Logistic => Ok(pointwise::logistic(first)),
        OperatorKind::MaxPool { window, filter } => pool::max_pool(first, window, filter),
        OperatorKind::Mean { keeps_axes } => pool::mean(first, ints(1)?, keeps_axes),
        OperatorKind::Pad => shapes::pad(first, ints(1)?),
        OperatorKind::Prelu => pointwise::prelu(first, floats(1)?),
        OperatorKind::Reshape => shapes::reshape(first, ints(1)?),
        OperatorKind::ResizeBilinear { half_pixels } => {
            resize::bilinear(first, ints(1)?, half_pixels)
        }
        OperatorKind::Unpack => Err("unpacks what is not a constant".into()),
    }
}
