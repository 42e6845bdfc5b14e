//! Weights of 32 or 16 bits, dense or sparse.

use super::bytes::Table;

/// Most numbers in the constants of a model: 256 MiB.
const MAX_NUMBERS: usize = 1 << 26;

/// The values of a constant tensor.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Constant {
    Floats(Vec<f32>),
    Ints(Vec<i32>),
}

const FLOAT32: u8 = 0;
const FLOAT16: u8 = 1;
const INT32: u8 = 2;

/// Reads constants up to a total number of values, which it counts.
#[derive(Debug)]
pub(super) struct Budget(usize);

impl Budget {
    pub(super) fn new() -> Self {
        Self(MAX_NUMBERS)
    }

    fn spend(&mut self, numbers: usize) -> Result<(), String> {
        let left = self.0.checked_sub(numbers);
        self.0 = left.ok_or_else(|| format!("the weights are more than {MAX_NUMBERS} numbers"))?;
        Ok(())
    }

    /// The values of `tensor` with the shape `shape` and the buffer `data`.
    pub(super) fn read(
        &mut self,
        tensor: Table,
        shape: &[usize],
        data: &[u8],
    ) -> Result<Constant, String> {
        let count = shape
            .iter()
            .try_fold(1usize, |count, side| count.checked_mul(*side))
            .ok_or("a shape is too large")?;
        // Sparse values unfold to the whole shape, so the declared count is what takes memory.
        self.spend(count)?;
        let kind = tensor.u8(1).unwrap_or(FLOAT32);
        if let Some(sparsity) = tensor.table(6) {
            let values = floats(kind, data)?;
            return sparse(sparsity, shape, count, &values).map(Constant::Floats);
        }
        let (constant, found) = if kind == INT32 {
            let (numbers, _) = data.as_chunks::<4>();
            let numbers: Vec<i32> = numbers.iter().map(|&b| i32::from_le_bytes(b)).collect();
            let found = numbers.len();
            (Constant::Ints(numbers), found)
        } else {
            let numbers = floats(kind, data)?;
            let found = numbers.len();
            (Constant::Floats(numbers), found)
        };
        if found != count {
            return Err(format!("{found} numbers for the shape {shape:?}"));
        }
        Ok(constant)
    }
}

fn floats(kind: u8, data: &[u8]) -> Result<Vec<f32>, String> {
    match kind {
        FLOAT32 => Ok(data
            .as_chunks::<4>()
            .0
            .iter()
            .map(|&bytes| f32::from_le_bytes(bytes))
            .collect()),
        FLOAT16 => Ok(data
            .as_chunks::<2>()
            .0
            .iter()
            .map(|&bytes| half(u16::from_le_bytes(bytes)))
            .collect()),
        other => Err(format!("numbers of type {other} are not supported")),
    }
}

/// The value of an IEEE half: 1 bit of sign, 5 of exponent, 10 of fraction.
fn half(bits: u16) -> f32 {
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    let exponent = i32::from(bits >> 10 & 31);
    let fraction = f32::from(bits & 1023) / 1024.0;
    sign * match exponent {
        0 => fraction * 2f32.powi(-14),
        31 if fraction == 0.0 => f32::INFINITY,
        31 => f32::NAN,
        _ => (1.0 + fraction) * 2f32.powi(exponent - 15),
    }
}

/// The dense values of a sparse tensor. Only the last dimension may be sparse: each of its rows has the columns of its
/// values other than 0.
fn sparse(
    sparsity: Table,
    shape: &[usize],
    count: usize,
    values: &[f32],
) -> Result<Vec<f32>, String> {
    let unsupported = || "weights are sparse in a way that is not supported".to_owned();
    let order = sparsity.i32s(0)?;
    let in_order = order.iter().zip(0..).all(|(&at, expected)| at == expected);
    let dimensions = sparsity.vector(2, 4).ok_or_else(unsupported)?;
    let columns = *shape.last().ok_or_else(unsupported)?;
    if order.len() != shape.len() || !in_order || !sparsity.i32s(1)?.is_empty() || columns == 0 {
        return Err(unsupported());
    }
    let mut last = None;
    for (at, dimension) in dimensions.tables().enumerate() {
        let dimension = dimension.ok_or_else(unsupported)?;
        let is_sparse = dimension.u8(0) == Some(1);
        if is_sparse != (at + 1 == shape.len()) {
            return Err(unsupported());
        }
        last = is_sparse.then_some(dimension);
    }
    let last = last.ok_or_else(unsupported)?;
    let segments = indices(last, 2).ok_or_else(unsupported)?;
    let at_columns = indices(last, 4).ok_or_else(unsupported)?;
    let broken = || "the indices of sparse weights do not fit their shape".to_owned();
    let mut dense = vec![0.0; count];
    if segments.len() != count / columns + 1 {
        return Err(broken());
    }
    for (row, ends) in dense.chunks_exact_mut(columns).zip(segments.windows(2)) {
        let range = ends[0]..ends[1];
        let row_columns = at_columns.get(range.clone()).ok_or_else(broken)?;
        let values = values.get(range).ok_or_else(broken)?;
        for (&column, value) in row_columns.iter().zip(values) {
            *row.get_mut(column).ok_or_else(broken)? = *value;
        }
    }
    Ok(dense)
}

/// A vector of 8, 16 or 32-bit numbers: its type is in field `number`, the vector in the next.
fn indices(dimension: Table, number: usize) -> Option<Vec<usize>> {
    let vector = dimension.table(number + 1)?;
    Some(match dimension.u8(number)? {
        1 => {
            let numbers = vector.vector(0, 4)?.i32s();
            let numbers = numbers.into_iter().map(usize::try_from);
            numbers.collect::<Result<_, _>>().ok()?
        }
        2 => {
            let numbers = vector.vector(0, 2)?.u16s();
            numbers.into_iter().map(usize::from).collect()
        }
        3 => {
            let numbers = vector.vector(0, 1)?;
            numbers.raw().iter().copied().map(usize::from).collect()
        }
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_what_they_mean() {
        let cases = [
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x3555, 0.333_251_95),
            (0x0001, 5.960_464_5e-8),
            (0x7bff, 65504.0),
            (0x7c00, f32::INFINITY),
        ];
        for (bits, value) in cases {
            assert_eq!(half(bits), value, "{bits:#06x}");
        }
        assert!(half(0x7e00).is_nan());
    }
}
