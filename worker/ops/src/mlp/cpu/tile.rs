//! One tile of rows through the network, forward or forward and backward, in the scratch memory of
//! the thread.

use super::layout::{Layer, Layout, Packed, Segment};
use super::memory::Region;
use super::product::{End, Factor, Fill, Gradient, Product};

/// Smallest number of rows per tile.
const ROWS: usize = 48;

/// The rows of a tile.
#[derive(Clone, Copy)]
pub(super) enum Rows<'a> {
    /// First row and number of consecutive rows.
    From(usize, usize),
    /// The rows with these indices.
    Picked(&'a [u32]),
}

impl Rows<'_> {
    fn len(self) -> usize {
        match self {
            Self::From(_, count) => count,
            Self::Picked(rows) => rows.len(),
        }
    }

    fn get(self, i: usize) -> usize {
        match self {
            Self::From(first, _) => first + i,
            Self::Picked(rows) => rows[i] as usize,
        }
    }
}

/// A network ready to run.
pub(super) struct Tiles<'a> {
    pub layout: &'a Layout,
    pub packed: &'a Packed,
    /// `[N, given]`.
    pub input: &'a [f32],
    /// Rows per tile.
    pub rows: usize,
    backward: bool,
}

/// The first words of a tile's buffers in its scratch memory.
struct Buffers {
    /// The input as f32 `[rows, padded]`.
    staged: usize,
    /// The input's cells.
    input: usize,
    /// Cells after each hidden layer.
    hidden: Vec<usize>,
    /// Cells of gradients to the results of layers: of the current layer and of the one before, alternating.
    result_gradients: [usize; 2],
    /// f32 panels: the output, or the gradient to the input.
    plain: usize,
    /// Words of all buffers.
    end: usize,
}

/// The gradients that a backward tile writes.
pub(super) struct Gradients<'a> {
    /// To the packed parameters; the tile adds to them.
    pub params: Region<'a, f32>,
    /// To the input's rows from `first` on, if they are needed.
    pub input: Option<&'a mut [f32]>,
    /// The row that `input` begins with.
    pub first: usize,
}

impl<'a> Tiles<'a> {
    pub(super) fn new(
        layout: &'a Layout,
        packed: &'a Packed,
        input: &'a [f32],
        backward: bool,
    ) -> Self {
        let mut tiles = Self {
            layout,
            packed,
            input,
            rows: 1,
            backward,
        };
        let row = 4 * tiles.buffers(1).end;
        let (bytes, most) = layout.kernels.tile;
        let rows = (bytes / row).clamp(ROWS, most);
        tiles.rows = rows.next_multiple_of(layout.kernels.rows);
        tiles
    }

    /// Words of scratch memory per tile.
    pub(super) fn words(&self) -> usize {
        self.buffers(self.rows).end
    }

    fn buffers(&self, rows: usize) -> Buffers {
        let layout = self.layout;
        let mut end = 0;
        let mut take = |width: usize| {
            let first = end;
            end += rows * layout.padded(width);
            first
        };
        let hidden = &layout.layers[..layout.layers.len() - 1];
        let widest = hidden.iter().map(|l| l.columns).max().unwrap_or(0);
        let (staged, input) = (take(layout.input), take(layout.input));
        let kept = if self.backward {
            hidden.iter().map(|l| take(l.columns)).collect()
        } else {
            let result_gradients = [take(widest), take(widest)];
            (0..hidden.len()).map(|l| result_gradients[l % 2]).collect()
        };
        let result_gradients = if self.backward {
            let widest = widest.max(layout.output);
            [take(widest), take(widest)]
        } else {
            [0, 0]
        };
        let plain = take(layout.output.max(layout.input));
        Buffers {
            staged,
            input,
            hidden: kept,
            result_gradients,
            plain,
            end,
        }
    }

    /// Number of rows with the padding that the products need.
    fn padded_rows(&self, rows: Rows) -> usize {
        rows.len().next_multiple_of(self.layout.kernels.rows)
    }

    /// Writes the tile's input to its buffers.
    fn stage(&self, rows: Rows, scratch: &mut Region<u32>, buffers: &Buffers) {
        let layout = self.layout;
        let (given, stride) = (layout.given(), layout.padded(layout.input));
        let count = self.padded_rows(rows);
        let staged = scratch.floats(buffers.staged..buffers.staged + count * stride);
        match &layout.angles {
            None => {
                for (i, to) in staged.chunks_exact_mut(stride).enumerate() {
                    let (own, rest) = to.split_at_mut(given);
                    if i < rows.len() {
                        let at = rows.get(i) * given;
                        own.copy_from_slice(&self.input[at..at + given]);
                    } else {
                        own.fill(0.0);
                    }
                    rest.fill(0.0);
                }
            }
            Some(angles) => {
                let mut points = vec![0f32; 3 * count];
                for (i, to) in points.chunks_exact_mut(3).enumerate() {
                    if i < rows.len() {
                        let at = rows.get(i) * 3;
                        to.copy_from_slice(&self.input[at..at + 3]);
                    }
                }
                for to in staged.chunks_exact_mut(stride) {
                    to[layout.input..].fill(0.0);
                }
                // SAFETY: the form is available on this machine.
                unsafe { (layout.kernels.encode)(angles, &points, staged, stride) }
            }
        }
        let fill = Fill {
            rows: count,
            width: layout.input,
            from: scratch.at(buffers.staged).cast(),
            cells: scratch.at(buffers.input),
        };
        // SAFETY: both buffers are `count` rows of the padded input; the form is available.
        unsafe { (layout.kernels.fill)(&fill) }
    }

    /// The factors that layer `l` multiplies with its weight.
    fn factors(&self, l: usize, scratch: &Region<u32>, buffers: &Buffers) -> Vec<Factor> {
        let factor = |segment: &Segment| {
            let first = if segment.input {
                buffers.input
            } else {
                buffers.hidden[l - 1]
            };
            Factor {
                cells: scratch.at(first),
                width: segment.width,
            }
        };
        self.layout.layers[l].segments.iter().map(factor).collect()
    }

    /// Runs layer `l`; the last one leaves its result in the plain buffer.
    fn layer(&self, l: usize, count: usize, scratch: &mut Region<u32>, buffers: &Buffers) {
        let layer = &self.layout.layers[l];
        let bias = self.packed.biases.read_floats()[layer.packed_bias..].as_ptr();
        let end = match buffers.hidden.get(l) {
            Some(to) => End::Hidden(bias, scratch.at(*to)),
            None => End::Output(bias, scratch.at(buffers.plain).cast()),
        };
        let product = Product {
            rows: count,
            factors: &self.factors(l, scratch, buffers),
            weights: self.packed.forward.read()[layer.forward..].as_ptr(),
            columns: layer.columns,
            end,
        };
        // SAFETY: `buffers` gave each factor and the result room for the tile's rows, and a
        // layer's result is never one of its factors; the form is available.
        unsafe { (self.layout.kernels.product)(&product) }
    }

    /// Writes the results of `rows` to `output` `[rows, output]`.
    pub(super) fn forward(&self, rows: Rows, scratch: &mut [u32], output: &mut [f32]) {
        let layout = self.layout;
        let buffers = self.buffers(self.rows);
        let count = self.padded_rows(rows);
        let scratch = &mut Region::new(scratch);
        self.stage(rows, scratch, &buffers);
        for l in 0..layout.layers.len() {
            self.layer(l, count, scratch, &buffers);
        }
        let plain = scratch.read_floats(buffers.plain..buffers.end);
        for (i, to) in output.chunks_exact_mut(layout.output).enumerate() {
            self.gather_row(plain, count, i, to);
        }
    }

    /// Copies row `i` of the f32 panels.
    fn gather_row(&self, panels: &[f32], count: usize, i: usize, to: &mut [f32]) {
        let panel = self.layout.kernels.panel;
        for (p, to) in to.chunks_mut(panel).enumerate() {
            let at = (p * count + i) * panel;
            to.copy_from_slice(&panels[at..at + to.len()]);
        }
    }

    /// Runs `rows` forward again, and adds their contributions to `gradients`, from the gradient `grad`
    /// `[N, output]` to the results.
    pub(super) fn backward(
        &self,
        rows: Rows,
        grad: &[f32],
        scratch: &mut [u32],
        gradients: &mut Gradients,
    ) {
        let layout = self.layout;
        let kernels = layout.kernels;
        let buffers = self.buffers(self.rows);
        let count = self.padded_rows(rows);
        let scratch = &mut Region::new(scratch);
        self.stage(rows, scratch, &buffers);
        let last = layout.layers.len() - 1;
        for l in 0..last {
            self.layer(l, count, scratch, &buffers);
        }
        self.stage_gradient(rows, grad, scratch, &buffers);
        // From the last layer to the first: ∂L/∂W = xᵀ ∂L/∂y, ∂L/∂x = ∂L/∂y Wᵀ, masked by the ReLU.
        let mut begun = false;
        for l in (0..=last).rev() {
            let layer = &layout.layers[l];
            let current = (last - l) % 2;
            let result = Factor {
                cells: scratch.at(buffers.result_gradients[current]),
                width: layer.columns,
            };
            let task = Gradient {
                rows: count,
                factors: &self.factors(l, scratch, &buffers),
                result,
                weights: gradients.params.at(layer.gradient),
                bias: gradients.params.at(layer.gradient_bias),
            };
            // SAFETY: the layout made room for each gradient; buffers as in `layer`.
            unsafe { (kernels.gradient)(&task) }
            for segment in &layer.segments {
                let end = if !segment.input {
                    End::Masked(
                        scratch.at(buffers.hidden[l - 1]),
                        scratch.at(buffers.result_gradients[1 - current]),
                    )
                } else if gradients.input.is_none() {
                    continue;
                } else {
                    let to = scratch.at(buffers.plain).cast();
                    if std::mem::replace(&mut begun, true) {
                        End::Added(to)
                    } else {
                        End::Fresh(to)
                    }
                };
                self.to_segment(layer, segment, count, result, end);
            }
        }
        self.write_input_gradient(rows, scratch, &buffers, gradients);
    }

    /// Propagates the gradient `result` to the result of a layer back to one of its factors.
    fn to_segment(&self, layer: &Layer, segment: &Segment, count: usize, result: Factor, end: End) {
        debug_assert_eq!(result.width, layer.columns);
        let product = Product {
            rows: count,
            factors: &[result],
            weights: self.packed.transposed.read()[segment.transposed..].as_ptr(),
            columns: segment.width,
            end,
        };
        // SAFETY: the buffers have room for the tile's rows; the factor and the result are
        // different ones; the form is available.
        unsafe { (self.layout.kernels.product)(&product) }
    }

    /// Writes the gradients to the results of `rows` into the first cells of gradients.
    fn stage_gradient(
        &self,
        rows: Rows,
        grad: &[f32],
        scratch: &mut Region<u32>,
        buffers: &Buffers,
    ) {
        let layout = self.layout;
        let (width, stride) = (layout.output, layout.padded(layout.output));
        let count = self.padded_rows(rows);
        let plain = scratch.floats(buffers.plain..buffers.plain + count * stride);
        for (i, to) in plain.chunks_exact_mut(stride).enumerate() {
            to.fill(0.0);
            if i < rows.len() {
                let at = rows.get(i) * width;
                to[..width].copy_from_slice(&grad[at..at + width]);
            }
        }
        let fill = Fill {
            rows: count,
            width,
            from: scratch.at(buffers.plain).cast(),
            cells: scratch.at(buffers.result_gradients[0]),
        };
        // SAFETY: both buffers are `count` rows of the padded output; the form is available.
        unsafe { (layout.kernels.fill)(&fill) }
    }

    /// Writes the gradients to the input of `rows`, if they are needed.
    fn write_input_gradient(
        &self,
        rows: Rows,
        scratch: &Region<u32>,
        buffers: &Buffers,
        gradients: &mut Gradients,
    ) {
        let layout = self.layout;
        let (given, stride) = (layout.given(), layout.padded(layout.input));
        let count = self.padded_rows(rows);
        let Some(input) = gradients.input.as_deref_mut() else {
            return;
        };
        let mut row = vec![0f32; layout.input];
        let scratch = scratch.read_floats(0..buffers.end);
        for i in 0..rows.len() {
            let at = (rows.get(i) - gradients.first) * given;
            let to = &mut input[at..at + given];
            match &layout.angles {
                None => self.gather_row(&scratch[buffers.plain..], count, i, to),
                Some(angles) => {
                    self.gather_row(&scratch[buffers.plain..], count, i, &mut row);
                    let staged = buffers.staged + i * stride;
                    let encoded = &scratch[staged..staged + layout.input];
                    // SAFETY: the form is available on this machine.
                    let point = unsafe { (layout.kernels.encode_backward)(angles, encoded, &row) };
                    to.copy_from_slice(&point);
                }
            }
        }
    }
}
