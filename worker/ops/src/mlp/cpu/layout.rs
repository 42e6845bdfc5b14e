//! Layout of a network's numbers: of its parameters, packed for the products, and of its gradients
//! before they are unpacked.

use super::encode::Angles;
use super::kernels::Kernels;
use super::memory::Words;
use super::vector::{bf16_bits, bf16_rounded};
use crate::mlp::{Input, MlpPlan};
use rayon::prelude::*;

/// A factor of a layer, and the part of the weight that it is multiplied with.
#[derive(Clone, Copy, Debug)]
pub(super) struct Segment {
    /// Whether the factor is the network's input; otherwise it is the result of the layer before.
    pub input: bool,
    /// Columns.
    pub width: usize,
    /// First number of the weight `[width, columns]` in the flat parameters.
    pub weight: usize,
    /// First word of the transposed weight among those packed for the backward pass.
    pub transposed: usize,
    /// First row in the layer's gradient.
    pub row: usize,
}

/// A layer.
#[derive(Clone, Debug)]
pub(super) struct Layer {
    /// The factors, side by side.
    pub segments: Vec<Segment>,
    /// Width of its result.
    pub columns: usize,
    /// First word of the weight among those packed for the forward pass.
    pub forward: usize,
    /// First number of the bias in the flat parameters.
    pub bias: usize,
    /// First number of the bias among those packed.
    pub packed_bias: usize,
    /// First number of the weight's gradient.
    pub gradient: usize,
    /// Rows of the weight's gradient.
    pub gradient_rows: usize,
    /// First number of the bias's gradient.
    pub gradient_bias: usize,
}

/// The whole network.
pub(super) struct Layout {
    pub kernels: &'static Kernels,
    pub layers: Vec<Layer>,
    /// Width of the first layer's factor.
    pub input: usize,
    /// Width of the result.
    pub output: usize,
    /// The encoding, if the input is points.
    pub angles: Option<Angles>,
    /// Index of each column in the plain input ([`Angles::order`]).
    order: Vec<usize>,
    /// Numbers of the gradients.
    pub gradients: usize,
    forward_words: usize,
    transposed_words: usize,
    biases: usize,
}

/// Parameters as the products read them.
pub(super) struct Packed {
    pub forward: Words,
    pub biases: Words,
    /// Empty without a backward pass.
    pub transposed: Words,
}

impl Layout {
    pub(super) fn new(plan: &MlpPlan, kernels: &'static Kernels) -> Self {
        let panel = kernels.panel;
        let angles = match &plan.input {
            Input::Features { .. } => None,
            Input::Frequencies { bands, raw } => Some(Angles::new(bands, *raw)),
        };
        let input = plan.input.width();
        let order = angles
            .as_ref()
            .map_or_else(|| (0..input).collect(), Angles::order);
        let (mut forward, mut transposed, mut biases, mut gradients) = (0, 0, 0, 0);
        let mut layers = Vec::with_capacity(plan.hidden.len() + 1);
        for shape in plan.layers() {
            let padded = shape.columns.next_multiple_of(panel);
            let mut segments = Vec::with_capacity(2);
            let (mut words, mut row) = (0, 0);
            for part in &shape.parts {
                segments.push(Segment {
                    input: part.input,
                    width: part.width,
                    weight: part.weight,
                    transposed,
                    row,
                });
                words += kernels.words(part.width);
                row += part.width.next_multiple_of(kernels.block);
                transposed += part.width.next_multiple_of(panel) * kernels.words(shape.columns);
            }
            layers.push(Layer {
                segments,
                columns: shape.columns,
                forward,
                bias: shape.bias,
                packed_bias: biases,
                gradient: gradients,
                gradient_rows: row,
                gradient_bias: gradients + row * padded,
            });
            forward += words * padded;
            biases += padded;
            gradients += (row + 1) * padded;
        }
        Self {
            kernels,
            layers,
            input,
            output: plan.output,
            angles,
            order,
            gradients,
            forward_words: forward,
            transposed_words: transposed,
            biases,
        }
    }

    /// Numbers per row of the operation's input.
    pub(super) fn given(&self) -> usize {
        if self.angles.is_some() { 3 } else { self.input }
    }

    /// `width` rounded up to panels.
    pub(super) fn padded(&self, width: usize) -> usize {
        width.next_multiple_of(self.kernels.panel)
    }

    /// Row of a segment's weight in the parameters.
    fn source(&self, segment: &Segment, row: usize) -> usize {
        if segment.input { self.order[row] } else { row }
    }

    /// The packed `params`, for a `backward` pass also transposed.
    pub(super) fn pack(&self, params: &[f32], backward: bool) -> Packed {
        let mut packed = Packed {
            forward: Words::zeroed(self.forward_words),
            biases: Words::zeroed(self.biases),
            transposed: Words::zeroed(if backward { self.transposed_words } else { 0 }),
        };
        let biases = packed.biases.floats();
        for layer in &self.layers {
            biases[layer.packed_bias..layer.packed_bias + layer.columns]
                .copy_from_slice(&params[layer.bias..layer.bias + layer.columns]);
        }
        let mut jobs: Vec<(&Layer, Option<&Segment>, &mut [u32])> = Vec::new();
        let (mut rest, mut back) = (packed.forward.words(), packed.transposed.words());
        for (l, layer) in self.layers.iter().enumerate() {
            let end = self
                .layers
                .get(l + 1)
                .map_or(self.forward_words, |n| n.forward);
            let (own, after) = rest.split_at_mut(end - layer.forward);
            jobs.push((layer, None, own));
            rest = after;
            for segment in layer.segments.iter().filter(|_| backward) {
                let words = self.padded(segment.width) * self.kernels.words(layer.columns);
                let (own, after) = back.split_at_mut(words);
                jobs.push((layer, Some(segment), own));
                back = after;
            }
        }
        let run = |(layer, segment, to): (&Layer, Option<&Segment>, &mut [u32])| match segment {
            None => self.pack_forward(params, layer, to),
            Some(segment) => self.pack_transposed(params, layer, segment, to),
        };
        // Miri finds that the queues of rayon's threads break Stacked Borrows.
        if cfg!(miri) {
            jobs.into_iter().for_each(run);
        } else {
            jobs.into_par_iter().for_each(run);
        }
        packed
    }

    /// A word of factors: two bf16, or one f32.
    fn word(&self, values: impl Fn(usize) -> f32) -> u32 {
        if self.kernels.pair == 2 {
            u32::from(bf16_bits(values(0))) | u32::from(bf16_bits(values(1))) << 16
        } else if self.kernels.rounded {
            bf16_rounded(values(0)).to_bits()
        } else {
            values(0).to_bits()
        }
    }

    fn pack_forward(&self, params: &[f32], layer: &Layer, to: &mut [u32]) {
        let (panel, pair) = (self.kernels.panel, self.kernels.pair);
        let mut rows = to.chunks_exact_mut(panel);
        for first in (0..layer.columns).step_by(panel) {
            let some = panel.min(layer.columns - first);
            for segment in &layer.segments {
                for word in 0..self.kernels.words(segment.width) {
                    let row = rows.next().expect("packed words for every row");
                    let k = word * pair;
                    let from: [&[f32]; 2] = std::array::from_fn(|i| {
                        if k + i >= segment.width {
                            return &[][..];
                        }
                        let source = self.source(segment, k + i);
                        let at = segment.weight + source * layer.columns + first;
                        &params[at..at + some]
                    });
                    for (c, word) in row[..some].iter_mut().enumerate() {
                        *word = self.word(|i| from[i].get(c).copied().unwrap_or(0.0));
                    }
                }
            }
        }
    }

    fn pack_transposed(&self, params: &[f32], layer: &Layer, segment: &Segment, to: &mut [u32]) {
        let (panel, pair) = (self.kernels.panel, self.kernels.pair);
        let mut rows = to.chunks_exact_mut(panel);
        for first in (0..segment.width).step_by(panel) {
            let some = panel.min(segment.width - first);
            for word in 0..self.kernels.words(layer.columns) {
                let row = rows.next().expect("packed words for every row");
                let n = word * pair;
                if n >= layer.columns {
                    continue;
                }
                for (c, word) in row[..some].iter_mut().enumerate() {
                    let source = self.source(segment, first + c);
                    let at = segment.weight + source * layer.columns + n;
                    let columns = layer.columns - n;
                    *word = self.word(|i| if i < columns { params[at + i] } else { 0.0 });
                }
            }
        }
    }

    /// The gradients to the `count` flat parameters, from the `gradients` that the products summed.
    pub(super) fn unpack(&self, gradients: &[f32], count: usize) -> Vec<f32> {
        let panel = self.kernels.panel;
        let mut params = vec![0f32; count];
        for layer in &self.layers {
            params[layer.bias..layer.bias + layer.columns].copy_from_slice(
                &gradients[layer.gradient_bias..layer.gradient_bias + layer.columns],
            );
            for segment in &layer.segments {
                for k in 0..segment.width {
                    let source = self.source(segment, k);
                    let to = segment.weight + source * layer.columns;
                    for (p, to) in params[to..to + layer.columns].chunks_mut(panel).enumerate() {
                        let row = p * layer.gradient_rows + segment.row + k;
                        let from = layer.gradient + row * panel;
                        to.copy_from_slice(&gradients[from..from + to.len()]);
                    }
                }
            }
        }
        params
    }
}
