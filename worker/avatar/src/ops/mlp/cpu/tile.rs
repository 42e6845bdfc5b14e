//! One tile of rows through the network, forward or forward and backward, in this thread's
//! scratch memory.

use super::layout::{Layer, Layout, Packed, Segment};
use super::product::{End, Factor, Fill, Gradient, Product};

/// Bytes of a tile's buffers that are aimed at: most of a core's second-level cache.
const BUDGET: usize = 800 << 10;
/// Fewest and most rows a tile.
const ROWS: (usize, usize) = (48, 240);

/// The rows of a tile.
#[derive(Clone, Copy)]
pub enum Rows<'a> {
    /// So many from this one on.
    From(usize, usize),
    /// These.
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
pub struct Tiles<'a> {
    pub layout: &'a Layout,
    pub packed: &'a Packed,
    /// `[N, given]`.
    pub input: &'a [f32],
    /// Rows a tile.
    pub rows: usize,
    backward: bool,
}

/// First words of a tile's buffers.
struct Buffers {
    /// The input as f32 `[rows, padded]`.
    staged: usize,
    /// The input's cells.
    input: usize,
    /// Cells after each hidden layer.
    hidden: Vec<usize>,
    /// Gradients to layers' results, in turn.
    turns: [usize; 2],
    /// f32 panels: the output, or the gradient to the input.
    plain: usize,
    end: usize,
}

/// What a backward tile writes.
pub struct Gradients<'a> {
    /// Of the packed parameters, added to.
    pub params: &'a mut [f32],
    /// Of the input's rows from `first` on, where it is asked for.
    pub input: Option<&'a mut [f32]>,
    /// The row that `input` begins with.
    pub first: usize,
}

impl<'a> Tiles<'a> {
    pub fn new(layout: &'a Layout, packed: &'a Packed, input: &'a [f32], backward: bool) -> Self {
        let mut tiles = Self {
            layout,
            packed,
            input,
            rows: 1,
            backward,
        };
        let row = 4 * tiles.buffers(1).end;
        let rows = (BUDGET / row).clamp(ROWS.0, ROWS.1);
        tiles.rows = rows.next_multiple_of(layout.kernels.rows);
        tiles
    }

    /// Words of scratch memory a tile.
    pub fn words(&self) -> usize {
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
            let turns = [take(widest), take(widest)];
            (0..hidden.len()).map(|l| turns[l % 2]).collect()
        };
        let turns = if self.backward {
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
            turns,
            plain,
            end,
        }
    }

    /// Rows as the products need them: padded, the rest zeros.
    fn padded_rows(&self, rows: Rows) -> usize {
        rows.len().next_multiple_of(self.layout.kernels.rows)
    }

    /// Puts the tile's input into its buffers.
    fn stage(&self, rows: Rows, scratch: &mut [u32], buffers: &Buffers) {
        let layout = self.layout;
        let (given, stride) = (layout.given(), layout.padded(layout.input));
        let count = self.padded_rows(rows);
        let staged = floats(&mut scratch[buffers.staged..buffers.staged + count * stride]);
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
                let mut points = [0f32; 3 * (ROWS.1 + 64)];
                for (i, to) in points[..3 * count].chunks_exact_mut(3).enumerate() {
                    if i < rows.len() {
                        let at = rows.get(i) * 3;
                        to.copy_from_slice(&self.input[at..at + 3]);
                    }
                }
                for to in staged.chunks_exact_mut(stride) {
                    to[layout.input..].fill(0.0);
                }
                // SAFETY: the kernels are those of a form that this machine has.
                unsafe { (layout.kernels.encode)(angles, &points[..3 * count], staged, stride) }
            }
        }
        let fill = Fill {
            rows: count,
            width: layout.input,
            from: scratch[buffers.staged..].as_ptr().cast(),
            cells: scratch[buffers.input..].as_mut_ptr(),
        };
        // SAFETY: both buffers are `count` rows of the padded input; the form is available.
        unsafe { (layout.kernels.fill)(&fill) }
    }

    /// What a layer multiplies.
    fn factors(&self, l: usize, scratch: *const u32, buffers: &Buffers) -> Vec<Factor> {
        let factor = |segment: &Segment| {
            let first = if segment.input {
                buffers.input
            } else {
                buffers.hidden[l - 1]
            };
            Factor {
                cells: scratch.wrapping_add(first),
                width: segment.width,
            }
        };
        self.layout.layers[l].segments.iter().map(factor).collect()
    }

    /// Runs layer `l`; the last one leaves its result in the plain buffer.
    fn layer(&self, l: usize, count: usize, scratch: &mut [u32], buffers: &Buffers) {
        let layer = &self.layout.layers[l];
        let base = scratch.as_mut_ptr();
        let bias = self.packed.biases.read_floats()[layer.packed_bias..].as_ptr();
        let end = match buffers.hidden.get(l) {
            Some(to) => End::Hidden(bias, base.wrapping_add(*to)),
            None => End::Output(bias, base.wrapping_add(buffers.plain).cast()),
        };
        let product = Product {
            rows: count,
            factors: &self.factors(l, base, buffers),
            weights: self.packed.forward.read()[layer.forward..].as_ptr(),
            columns: layer.columns,
            end,
        };
        // SAFETY: `buffers` gave each factor and the result room for the tile's rows, and a
        // layer's result is never one of its factors; the form is available.
        unsafe { (self.layout.kernels.product)(&product) }
    }

    /// Writes the results of `rows` to `output` `[rows, output]`.
    pub fn forward(&self, rows: Rows, scratch: &mut [u32], output: &mut [f32]) {
        let layout = self.layout;
        let buffers = self.buffers(self.rows);
        let count = self.padded_rows(rows);
        self.stage(rows, scratch, &buffers);
        for l in 0..layout.layers.len() {
            self.layer(l, count, scratch, &buffers);
        }
        let plain = floats(&mut scratch[buffers.plain..]);
        for (i, to) in output.chunks_exact_mut(layout.output).enumerate() {
            self.gather_row(plain, count, i, to);
        }
    }

    /// Row `i` of the f32 panels.
    fn gather_row(&self, panels: &[f32], count: usize, i: usize, to: &mut [f32]) {
        let panel = self.layout.kernels.panel;
        for (p, to) in to.chunks_mut(panel).enumerate() {
            let at = (p * count + i) * panel;
            to.copy_from_slice(&panels[at..at + to.len()]);
        }
    }

    /// Runs `rows` forward again and adds to the gradients what the gradient `grad`
    /// `[N, output]` to the results makes.
    pub fn backward(
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
        self.stage(rows, scratch, &buffers);
        let last = layout.layers.len() - 1;
        for l in 0..last {
            self.layer(l, count, scratch, &buffers);
        }
        self.stage_gradient(rows, grad, scratch, &buffers);
        let mut begun = false;
        for l in (0..=last).rev() {
            let layer = &layout.layers[l];
            let base = scratch.as_mut_ptr();
            let turn = (last - l) % 2;
            let result = Factor {
                cells: base.wrapping_add(buffers.turns[turn]),
                width: layer.columns,
            };
            let weights = gradients.params[layer.gradient..].as_mut_ptr();
            let bias = gradients.params[layer.gradient_bias..].as_mut_ptr();
            let task = Gradient {
                rows: count,
                factors: &self.factors(l, base, &buffers),
                result,
                weights,
                bias,
            };
            // SAFETY: the layout gave each gradient its room; buffers as in `layer`.
            unsafe { (kernels.gradient)(&task) }
            for segment in &layer.segments {
                let end = if !segment.input {
                    End::Masked(
                        base.wrapping_add(buffers.hidden[l - 1]),
                        base.wrapping_add(buffers.turns[1 - turn]),
                    )
                } else if gradients.input.is_none() {
                    continue;
                } else {
                    let to = base.wrapping_add(buffers.plain).cast();
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

    /// Puts the gradients to the results of `rows` into the first turn's cells.
    fn stage_gradient(&self, rows: Rows, grad: &[f32], scratch: &mut [u32], buffers: &Buffers) {
        let layout = self.layout;
        let (width, stride) = (layout.output, layout.padded(layout.output));
        let count = self.padded_rows(rows);
        let plain = floats(&mut scratch[buffers.plain..buffers.plain + count * stride]);
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
            from: scratch[buffers.plain..].as_ptr().cast(),
            cells: scratch[buffers.turns[0]..].as_mut_ptr(),
        };
        // SAFETY: both buffers are `count` rows of the padded output; the form is available.
        unsafe { (layout.kernels.fill)(&fill) }
    }

    fn write_input_gradient(
        &self,
        rows: Rows,
        scratch: &mut [u32],
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
        let scratch = floats(scratch);
        for i in 0..rows.len() {
            let at = (rows.get(i) - gradients.first) * given;
            let to = &mut input[at..at + given];
            match &layout.angles {
                None => self.gather_row(&scratch[buffers.plain..], count, i, to),
                Some(angles) => {
                    self.gather_row(&scratch[buffers.plain..], count, i, &mut row);
                    let staged = buffers.staged + i * stride;
                    let encoded = &scratch[staged..staged + layout.input];
                    // SAFETY: the kernels are those of a form that this machine has.
                    let point = unsafe { (layout.kernels.encode_backward)(angles, encoded, &row) };
                    to.copy_from_slice(&point);
                }
            }
        }
    }
}

/// Words as numbers.
fn floats(words: &mut [u32]) -> &mut [f32] {
    // SAFETY: same size and alignment, each pattern of bits is an f32, borrowed alone.
    unsafe { std::slice::from_raw_parts_mut(words.as_mut_ptr().cast(), words.len()) }
}
