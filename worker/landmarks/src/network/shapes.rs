//! Operations that move numbers without changing them.

use super::window::picture;
use super::{Made, Operation};

/// Most runs of an operation, as each takes memory.
const MAX_RUNS: usize = 1 << 20;

fn bounded(runs: usize) -> Result<(), String> {
    if runs > MAX_RUNS {
        return Err(format!("moves {runs} runs of numbers: at most {MAX_RUNS}"));
    }
    Ok(())
}

/// Copies runs of numbers.
#[derive(Debug)]
struct Copies {
    /// Index of the input, offset in it, offset in the output, count.
    runs: Vec<[usize; 4]>,
}

impl Operation for Copies {
    fn run(&self, inputs: &[&[f32]], out: &mut [f32]) {
        for &[input, from, to, count] in &self.runs {
            out[to..to + count].copy_from_slice(&inputs[input][from..from + count]);
        }
    }
}

/// The numbers in the shape `wanted`. One side may be -1, and follows from the others.
pub(super) fn reshape(shape: &[usize], wanted: &[i32]) -> Result<Made, String> {
    let impossible = || format!("{shape:?} can't become {wanted:?}");
    let len: usize = shape.iter().product();
    let known = wanted.iter().filter(|side| **side != -1);
    let mut known = known.map(|side| usize::try_from(*side).ok());
    let known = known.try_fold(1usize, |product, side| product.checked_mul(side?));
    let left = known.and_then(|known| len.checked_div(known));
    let left = left.ok_or_else(impossible)?;
    let side = |side: &i32| usize::try_from(*side).unwrap_or(left);
    let sides: Vec<usize> = wanted.iter().map(side).collect();
    let product = sides.iter().try_fold(1usize, |a, &b| a.checked_mul(b));
    if product != Some(len) {
        return Err(impossible());
    }
    let runs = vec![[0, 0, 0, len]];
    Ok((Box::new(Copies { runs }), sides))
}

/// Concatenation of values along `axis`.
pub(super) fn concatenation(shapes: &[&[usize]], axis: i32) -> Result<Made, String> {
    let first = *shapes.first().ok_or("nothing to join")?;
    let sides = first.len() as i32;
    let axis = usize::try_from(if axis < 0 { axis + sides } else { axis });
    let axis = axis.ok().filter(|axis| *axis < first.len());
    let axis = axis.ok_or("there is no such axis")?;
    let others = |shape: &[usize]| {
        let mut others = shape.to_vec();
        if let Some(side) = others.get_mut(axis) {
            *side = 0;
        }
        others
    };
    if shapes.iter().any(|shape| others(shape) != others(first)) {
        return Err(format!("{shapes:?} can't be joined"));
    }
    let mut joined = first.to_vec();
    joined[axis] = shapes.iter().map(|shape| shape[axis]).sum();
    let outer: usize = first[..axis].iter().product();
    bounded(outer.saturating_mul(shapes.len()))?;
    let run = |shape: &[usize]| shape[axis..].iter().product::<usize>();
    let mut runs = Vec::new();
    let mut to = 0;
    for at in 0..outer {
        for (input, shape) in shapes.iter().enumerate() {
            let count = run(shape);
            runs.push([input, at * count, to, count]);
            to += count;
        }
    }
    Ok((Box::new(Copies { runs }), joined))
}

/// Rearrangement of channels into blocks of pixels.
pub(super) fn depth_to_space(shape: &[usize], block: usize) -> Result<Made, String> {
    let [height, width, channels] = picture(shape)?;
    let per_pixel = channels / (block * block);
    if per_pixel * block * block != channels {
        return Err(format!("{channels} channels in blocks of {block}"));
    }
    bounded(height * width * block)?;
    let mut runs = Vec::new();
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        for row in 0..block {
            let from = (y * width + x) * channels + row * block * per_pixel;
            let to = ((y * block + row) * width + x) * block * per_pixel;
            runs.push([0, from, to, block * per_pixel]);
        }
    }
    let shape = vec![1, height * block, width * block, per_pixel];
    Ok((Box::new(Copies { runs }), shape))
}

#[derive(Debug)]
struct Pad {
    copies: Copies,
}

impl Operation for Pad {
    fn run(&self, inputs: &[&[f32]], out: &mut [f32]) {
        out.fill(0.0);
        self.copies.run(inputs, out);
    }
}

/// A picture padded with zeros; `zeros` is `[4, 2]`, their number before and after each axis.
pub(super) fn pad(shape: &[usize], zeros: &[i32]) -> Result<Made, String> {
    let [height, width, channels] = picture(shape)?;
    let pairs = zeros.as_chunks::<2>().0;
    let pairs = pairs.iter().map(|pair| pair.map(|zeros| zeros as usize));
    let pairs: Vec<[usize; 2]> = pairs.collect();
    let [[0, 0], [top, bottom], [left, right], [front, back]] = pairs[..] else {
        return Err(format!("zeros of {zeros:?} around a picture"));
    };
    if zeros.iter().any(|zeros| !(0..=4096).contains(zeros)) {
        return Err(format!("zeros of {zeros:?} around a picture"));
    }
    let (wide, deep) = (left + width + right, front + channels + back);
    bounded(height * width)?;
    let mut runs = Vec::new();
    for y in 0..height {
        let to = (((top + y) * wide + left) * deep) + front;
        if deep == channels {
            runs.push([0, y * width * channels, to, width * channels]);
            continue;
        }
        for x in 0..width {
            runs.push([0, (y * width + x) * channels, to + x * deep, channels]);
        }
    }
    let copies = Copies { runs };
    let shape = vec![1, top + height + bottom, wide, deep];
    Ok((Box::new(Pad { copies }), shape))
}
