//! Arrays of numbers.

/// An array of numbers with the last axis fastest. All number types become f64, which is exact for numbers of up to
/// 53 bits.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Array {
    /// Extents; empty for a single number.
    pub shape: Vec<usize>,
    /// The numbers; the product of the shape is their count.
    pub values: Vec<f64>,
}

impl Array {
    /// The numbers, if the shape equals `shape` without axes of extent 1 in both: files of the same program may have
    /// `[10]` or `[1, 10]`.
    pub fn squeezed(&self, shape: &[usize]) -> Option<&[f64]> {
        let kept = |shape: &[usize]| -> Vec<usize> {
            shape.iter().copied().filter(|side| *side != 1).collect()
        };
        (kept(&self.shape) == kept(shape)).then_some(&self.values)
    }

    /// The numbers of [`Self::squeezed`], for a length known at compile time.
    pub fn fixed<const N: usize>(&self) -> Option<[f64; N]> {
        self.squeezed(&[N])?.try_into().ok()
    }

    /// Rows of `N` numbers of an array `[any, N]`.
    pub fn rows<const N: usize>(&self) -> Option<Vec<[f64; N]>> {
        match self.shape[..] {
            [_, columns] if columns == N => Some(self.values.as_chunks::<N>().0.to_vec()),
            _ => None,
        }
    }

    /// The part at `at` on the first axis; `None` beyond it, and of a single number.
    pub fn row(&self, at: usize) -> Option<Self> {
        let (rows, shape) = self.shape.split_first()?;
        let size = shape.iter().product();
        let values = self.values.get(at.checked_mul(size)?..)?.get(..size)?;
        (at < *rows).then(|| Self {
            shape: shape.to_vec(),
            values: values.to_vec(),
        })
    }

    /// A matrix of `R` rows and `C` columns.
    pub fn matrix<const R: usize, const C: usize>(&self) -> Option<[[f64; C]; R]> {
        self.rows::<C>()?.try_into().ok()
    }

    /// Index of the first number that is not finite; `None` if all are finite.
    pub fn not_finite(&self) -> Option<usize> {
        self.values.iter().position(|value| !value.is_finite())
    }
}

/// The product of `shape`, unless it overflows.
pub(crate) fn count(shape: &[usize]) -> Option<usize> {
    shape
        .iter()
        .try_fold(1usize, |product, side| product.checked_mul(*side))
}

/// Reorders numbers with the first axis fastest to the last axis fastest.
pub(crate) fn rows_first<T: Clone>(shape: &[usize], values: Vec<T>) -> Vec<T> {
    if shape.len() < 2 || values.is_empty() {
        return values;
    }
    let mut at = vec![0; shape.len()];
    let mut sorted = Vec::with_capacity(values.len());
    for _ in 0..values.len() {
        let from = at
            .iter()
            .zip(shape)
            .rev()
            .fold(0, |from, (index, side)| from * side + index);
        sorted.extend(values.get(from).cloned());
        for (index, side) in at.iter_mut().zip(shape).rev() {
            *index += 1;
            if *index < *side {
                break;
            }
            *index = 0;
        }
    }
    sorted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_first_is_turned_for_any_number_of_axes() {
        // numpy.arange(24).reshape(2, 3, 4) written with order "F".
        let shape = [2, 3, 4];
        let written: Vec<usize> = (0..24)
            .map(|i| (i % 2) * 12 + (i / 2 % 3) * 4 + i / 6)
            .collect();
        assert_eq!(rows_first(&shape, written), (0..24).collect::<Vec<usize>>());
        assert_eq!(rows_first(&[3], vec![1, 2, 3]), [1, 2, 3]);
        assert!(rows_first(&[0, 4], Vec::<u8>::new()).is_empty());
    }

    #[test]
    fn shapes_are_asked_for_without_single_axes() {
        let array = Array {
            shape: vec![1, 3],
            values: vec![1.0, 2.0, 3.0],
        };
        assert_eq!(array.fixed::<3>(), Some([1.0, 2.0, 3.0]));
        assert_eq!(array.fixed::<2>(), None);
        assert_eq!(array.matrix::<1, 3>(), Some([[1.0, 2.0, 3.0]]));
        assert_eq!(array.matrix::<3, 1>(), None);
        let row = array.row(0).expect("a row");
        assert_eq!((row.shape, row.values), (vec![3], vec![1.0, 2.0, 3.0]));
        assert_eq!(array.row(1), None);
        assert_eq!(Array::default().row(0), None);
    }
}
