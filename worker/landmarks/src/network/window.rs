//! Sizes of pictures, and the movement of filters over them.

use crate::tflite::{Padding, Window};

/// Rows, columns and channels of a picture of the shape `[1, height, width, channels]`.
pub(super) fn picture(shape: &[usize]) -> Result<[usize; 3], String> {
    match *shape {
        [1, height, width, channels] if height * width * channels > 0 => {
            Ok([height, width, channels])
        }
        _ => Err(format!("{shape:?} is not the shape of one picture")),
    }
}

/// The positions of a filter along one side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Side {
    /// Pixels of the input.
    pub(super) input: usize,
    /// Pixels of the output.
    pub(super) output: usize,
    /// Pixels of padding before the first.
    pub(super) before: usize,
    pub(super) stride: usize,
    pub(super) dilation: usize,
    /// Pixels of the filter.
    pub(super) filter: usize,
}

impl Side {
    /// The input pixel under tap `tap` of the filter for the output pixel `at`; `None` in the padding.
    pub(super) fn under(&self, at: usize, tap: usize) -> Option<usize> {
        let from = at * self.stride + tap * self.dilation;
        from.checked_sub(self.before)
            .filter(|&from| from < self.input)
    }
}

impl Window {
    /// The positions of `filter` over `input` along both sides (rows, columns).
    pub(super) fn sides(self, input: [usize; 2], filter: [usize; 2]) -> Result<[Side; 2], String> {
        let side = |at: usize| {
            let (input, filter) = (input[at], filter[at]);
            let (stride, dilation) = (self.stride[at], self.dilation[at]);
            let reach = (filter.max(1) - 1) * dilation + 1;
            let (output, before) = match self.padding {
                Padding::Same => {
                    let output = input.div_ceil(stride);
                    let needed = (output - 1) * stride + reach;
                    (output, needed.saturating_sub(input) / 2)
                }
                Padding::Valid if reach <= input && filter > 0 => ((input - reach) / stride + 1, 0),
                Padding::Valid => {
                    return Err(format!("a filter of {reach} pixels over {input}"));
                }
            };
            Ok(Side {
                input,
                output,
                before,
                stride,
                dilation,
                filter,
            })
        };
        Ok([side(0)?, side(1)?])
    }
}
