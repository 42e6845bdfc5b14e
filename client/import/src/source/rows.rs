//! Arrays with one row for each pose.

use super::Part;
use crate::ImportError;

impl Part<'_> {
    /// `[any, N]`, of an array whose further axes hold `N` numbers together, such as
    /// `[any, 24, 3, 3]`.
    pub(crate) fn flat_rows<const N: usize>(&self) -> Result<Vec<[f64; N]>, ImportError> {
        self.array()?;
        self.unchecked_rows(None)
    }

    /// The rows of [`Self::flat_rows`], finite or not; exactly `rows` of them, if given.
    pub(crate) fn unchecked_rows<const N: usize>(
        &self,
        rows: Option<usize>,
    ) -> Result<Vec<[f64; N]>, ImportError> {
        let array = self.unchecked()?;
        let found = array.shape.first().copied().unwrap_or_default();
        if array.values.len() != found.saturating_mul(N) {
            return Err(self.wrong(&format!("[…, {N}]")));
        }
        if let Some(rows) = rows.filter(|rows| *rows != found) {
            let message = format!("{found} rows for {rows} poses");
            return Err(self.fault("SIZE_MISMATCH", message));
        }
        Ok(array.values.as_chunks::<N>().0.to_vec())
    }

    /// Shape parameters of `rows` poses, finite or not: as many rows, or one for all.
    pub(crate) fn same_betas(&self, rows: usize) -> Result<Vec<Vec<f64>>, ImportError> {
        let array = self.unchecked()?;
        let found = match array.shape[..] {
            [_] | [1, _] => 1,
            [found, _] => found,
            _ => return Err(self.wrong("[poses, shape parameters]")),
        };
        let length = array.values.len() / found.max(1);
        if length == 0 || (found != rows && found != 1) {
            let message = format!("{found} rows for {rows} poses");
            return Err(self.fault("SIZE_MISMATCH", message));
        }
        let given = array.values.chunks_exact(length).map(<[f64]>::to_vec);
        Ok(given.cycle().take(rows).collect())
    }

    /// Numbers of frames, from 0, one for each of `rows` poses.
    pub(crate) fn numbers(&self, rows: usize) -> Result<Vec<usize>, ImportError> {
        let found = self.vector()?;
        if found.len() != rows {
            let message = format!("{} numbers for {rows} poses", found.len());
            return Err(self.fault("SIZE_MISMATCH", message));
        }
        let whole = |number: &f64| *number >= 0.0 && number.fract() == 0.0;
        if let Some(at) = found.iter().position(|number| !whole(number)) {
            let message = "not the number of a frame";
            let part = self.below(format!("{}[{at}]", self.field), self.value);
            return Err(part.fault("OUT_OF_RANGE", message));
        }
        Ok(found.iter().map(|number| *number as usize).collect())
    }

    /// `N` numbers, whatever their axes, finite or not.
    pub(crate) fn flat<const N: usize>(&self) -> Result<[f64; N], ImportError> {
        let values = self.unchecked()?.values;
        values
            .try_into()
            .map_err(|_| self.wrong(&format!("{N} numbers")))
    }

    /// The `N` numbers, finite or not, of item `at`, of a list of arrays or of an array with one more axis.
    pub(crate) fn item<const N: usize>(&self, at: usize) -> Result<[f64; N], ImportError> {
        if self.is_list() {
            return self.at(at)?.flat();
        }
        let rows = self.unchecked_rows::<N>(None)?;
        rows.get(at).copied().ok_or_else(|| {
            let message = format!("there is no item {at}: there are {}", rows.len());
            self.fault("MISSING", message)
        })
    }
}
