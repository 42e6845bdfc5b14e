//! Resizing of pictures.

use super::window::picture;
use super::{Made, Operation};
use rayon::prelude::*;

/// For each output pixel along one side: its two neighbours in the input, and the weight of the second.
type Neighbours = Vec<([usize; 2], f32)>;

#[derive(Debug)]
struct Bilinear {
    rows: Neighbours,
    columns: Neighbours,
    width: usize,
    channels: usize,
}

/// Bilinear interpolation to the size `[height, width]`.
pub(super) fn bilinear(shape: &[usize], size: &[i32], half_pixels: bool) -> Result<Made, String> {
    let [height, width, channels] = picture(shape)?;
    let side = |at: usize| match size.get(at) {
        Some(&side @ 1..=8192) => Ok(side as usize),
        _ => Err(format!("the size {size:?} is not possible")),
    };
    let made = Bilinear {
        rows: neighbours(height, side(0)?, half_pixels),
        columns: neighbours(width, side(1)?, half_pixels),
        width,
        channels,
    };
    let shape = vec![1, made.rows.len(), made.columns.len(), channels];
    Ok((Box::new(made), shape))
}

fn neighbours(from: usize, to: usize, half_pixels: bool) -> Neighbours {
    let scale = from as f32 / to as f32;
    let half = if half_pixels { 0.5 } else { 0.0 };
    let position = |at: usize| {
        let position = ((at as f32 + half) * scale - half).max(0.0);
        let first = (position as usize).min(from - 1);
        let second = (first + 1).min(from - 1);
        ([first, second], (position - first as f32).clamp(0.0, 1.0))
    };
    (0..to).map(position).collect()
}

impl Operation for Bilinear {
    fn run(&self, inputs: &[&[f32]], out: &mut [f32]) {
        let (input, channels) = (inputs[0], self.channels);
        let lines = out.par_chunks_exact_mut(self.columns.len() * channels);
        lines.zip(&self.rows).for_each(|(line, &(rows, down))| {
            let pixels = line.chunks_exact_mut(channels);
            for (out, &(columns, right)) in pixels.zip(&self.columns) {
                let at = |row: usize, column: usize| {
                    let from = (rows[row] * self.width + columns[column]) * channels;
                    &input[from..from + channels]
                };
                let (top, bottom) = ((at(0, 0), at(0, 1)), (at(1, 0), at(1, 1)));
                for (channel, out) in out.iter_mut().enumerate() {
                    let mix =
                        |(a, b): (&[f32], &[f32])| a[channel] + (b[channel] - a[channel]) * right;
                    let (top, bottom) = (mix(top), mix(bottom));
                    *out = top + (bottom - top) * down;
                }
            }
        });
    }
}
