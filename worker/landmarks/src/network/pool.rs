//! Max pooling, and the mean of a picture.

use super::window::{Side, picture};
use super::{Made, Operation};
use crate::tflite::Window;

#[derive(Debug)]
struct MaxPool {
    rows: Side,
    columns: Side,
    channels: usize,
}

/// The maximum of each channel under a filter of (rows, columns).
pub(super) fn max_pool(
    shape: &[usize],
    window: Window,
    filter: [usize; 2],
) -> Result<Made, String> {
    let [height, width, channels] = picture(shape)?;
    let [rows, columns] = window.sides([height, width], filter)?;
    let made = MaxPool {
        rows,
        columns,
        channels,
    };
    let shape = vec![1, rows.output, columns.output, channels];
    Ok((Box::new(made), shape))
}

impl Operation for MaxPool {
    fn run(&self, inputs: &[&[f32]], out: &mut [f32]) {
        for (pixel, out) in out.chunks_exact_mut(self.channels).enumerate() {
            let (y, x) = (pixel / self.columns.output, pixel % self.columns.output);
            out.fill(f32::NEG_INFINITY);
            for row in (0..self.rows.filter).filter_map(|tap| self.rows.under(y, tap)) {
                for column in (0..self.columns.filter).filter_map(|tap| self.columns.under(x, tap))
                {
                    let from = (row * self.columns.input + column) * self.channels;
                    for (out, value) in out.iter_mut().zip(&inputs[0][from..]) {
                        *out = out.max(*value);
                    }
                }
            }
        }
    }
}

#[derive(Debug)]
struct Mean {
    channels: usize,
}

/// The mean of each channel over a whole picture; `axes` are the rows and columns.
pub(super) fn mean(shape: &[usize], axes: &[i32], keeps_axes: bool) -> Result<Made, String> {
    let [.., channels] = picture(shape)?;
    if axes != [1, 2] {
        return Err(format!("a mean over the axes {axes:?} of a picture"));
    }
    let shape = match keeps_axes {
        true => vec![1, 1, 1, channels],
        false => vec![1, channels],
    };
    Ok((Box::new(Mean { channels }), shape))
}

impl Operation for Mean {
    fn run(&self, inputs: &[&[f32]], out: &mut [f32]) {
        let pixels = inputs[0].chunks_exact(self.channels);
        let share = 1.0 / pixels.len() as f32;
        out.fill(0.0);
        for pixel in pixels {
            for (out, value) in out.iter_mut().zip(pixel) {
                *out += share * value;
            }
        }
    }
}
