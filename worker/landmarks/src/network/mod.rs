//! Runs a model on the CPU. Pictures stay `[height, width, channels]`, as in TensorFlow Lite, so a 1 × 1 convolution is a
//! matrix product, and a depthwise convolution works on neighbouring channels.

mod conv;
mod depthwise;
mod plan;
mod pointwise;
mod pool;
mod resize;
mod shapes;
mod window;

#[cfg(test)]
mod tests;

use crate::tflite::Graph;
use std::fmt::Debug;

/// A step with its weights and sizes.
trait Operation: Debug + Send + Sync {
    /// Computes all of `out` from `inputs`, which have the lengths for which it was made.
    fn run(&self, inputs: &[&[f32]], out: &mut [f32]);
}

/// An operation and the shape of its output.
type Made = (Box<dyn Operation>, Vec<usize>);

/// A step: an operation, the buffers that it reads, and the one that it fills.
#[derive(Debug)]
struct Step {
    operation: Box<dyn Operation>,
    /// Buffers with the lengths of the values in them.
    inputs: Vec<(usize, usize)>,
    output: (usize, usize),
}

/// A model, ready to run.
#[derive(Debug)]
pub(crate) struct Network {
    steps: Vec<Step>,
    buffers: Vec<Vec<f32>>,
    input: (usize, usize),
    /// Shapes of the outputs, in the file's order, with their buffers.
    outputs: Vec<(Vec<usize>, usize)>,
}

impl Network {
    /// Reads a TensorFlow Lite model.
    ///
    /// # Errors
    /// A message for people.
    pub(crate) fn read(bytes: &[u8]) -> Result<Self, String> {
        plan::plan(Graph::read(bytes)?)
    }

    /// Number of input values.
    pub(crate) fn input_len(&self) -> usize {
        self.input.1
    }

    /// Index of the only output with the shape `shape`.
    pub(crate) fn output(&self, shape: &[usize]) -> Option<usize> {
        self.outputs.iter().position(|(found, _)| found == shape)
    }

    /// Shapes of the outputs, in the file's order.
    pub(crate) fn shapes(&self) -> impl Iterator<Item = &[usize]> {
        self.outputs.iter().map(|(shape, _)| shape.as_slice())
    }

    /// The input values, to be filled before [`run`](Self::run).
    pub(crate) fn input(&mut self) -> &mut [f32] {
        let (buffer, len) = self.input;
        &mut self.buffers[buffer][..len]
    }

    /// Runs the model on its input.
    pub(crate) fn run(&mut self) {
        for step in &self.steps {
            let (output, len) = step.output;
            let mut filled = std::mem::take(&mut self.buffers[output]);
            let inputs: Vec<&[f32]> = step
                .inputs
                .iter()
                .map(|&(buffer, len)| &self.buffers[buffer][..len])
                .collect();
            step.operation.run(&inputs, &mut filled[..len]);
            self.buffers[output] = filled;
        }
    }

    /// Values of the output with the index `position`, after [`run`](Self::run).
    pub(crate) fn result(&self, position: usize) -> &[f32] {
        let Some((shape, buffer)) = self.outputs.get(position) else {
            return &[];
        };
        &self.buffers[*buffer][..shape.iter().product()]
    }
}
