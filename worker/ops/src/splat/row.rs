//! The numbers of a splat in a row, as kernels read them: one slice for all splats keeps their numbers together.

/// Numbers per splat: mean (3), rotation (4), scales (3), opacity (1) and colour (3).
pub const ROW: usize = 14;
/// First column of the mean.
pub(super) const MEAN: usize = 0;
/// First column of the rotation.
pub(super) const ROTATION: usize = 3;
/// First column of the scales.
pub(super) const SCALES: usize = 7;
/// Column of the opacity.
pub(super) const OPACITY: usize = 10;
/// First column of the colour.
pub(super) const COLOUR: usize = 11;

/// A row of numbers by their meaning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplatRow {
    /// Canonical mean, metres.
    pub mean: [f32; 3],
    /// Canonical rotation: a quaternion wxyz of any length but 0.
    pub rotation: [f32; 4],
    /// Logarithms of the standard deviations along the rotated axes, metres.
    pub scales: [f32; 3],
    /// Logit of the opacity.
    pub opacity: f32,
    /// Colour without light.
    pub colour: [f32; 3],
}

impl SplatRow {
    /// Opacity at the centre, 0 to 1.
    pub fn alpha(&self) -> f32 {
        1.0 / (1.0 + (-self.opacity).exp())
    }

    /// Standard deviations along the rotated axes, metres.
    pub fn deviations(&self) -> [f32; 3] {
        self.scales.map(f32::exp)
    }
}

impl From<[f32; ROW]> for SplatRow {
    #[inline(always)]
    fn from(row: [f32; ROW]) -> Self {
        Self {
            mean: std::array::from_fn(|axis| row[MEAN + axis]),
            rotation: std::array::from_fn(|part| row[ROTATION + part]),
            scales: std::array::from_fn(|axis| row[SCALES + axis]),
            opacity: row[OPACITY],
            colour: std::array::from_fn(|channel| row[COLOUR + channel]),
        }
    }
}

impl From<SplatRow> for [f32; ROW] {
    #[inline(always)]
    fn from(row: SplatRow) -> Self {
        let mut numbers = [0.0; ROW];
        numbers[MEAN..ROTATION].copy_from_slice(&row.mean);
        numbers[ROTATION..SCALES].copy_from_slice(&row.rotation);
        numbers[SCALES..OPACITY].copy_from_slice(&row.scales);
        numbers[OPACITY] = row.opacity;
        numbers[COLOUR..].copy_from_slice(&row.colour);
        numbers
    }
}

/// The rows in a slice of their numbers.
pub fn splat_rows(rows: &[f32]) -> impl ExactSizeIterator<Item = SplatRow> + Clone + '_ {
    rows.as_chunks::<ROW>().0.iter().map(|row| (*row).into())
}

/// The means `[N, 3]` of `rows` `[N, 14]`.
pub fn means_of_rows(rows: &[f32]) -> Vec<f32> {
    splat_rows(rows).flat_map(|row| row.mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_at_their_columns() {
        let numbers: [f32; ROW] = std::array::from_fn(|column| column as f32);
        let row = SplatRow::from(numbers);
        let first = [
            row.mean[0],
            row.rotation[0],
            row.scales[0],
            row.opacity,
            row.colour[0],
        ];
        let columns = [MEAN, ROTATION, SCALES, OPACITY, COLOUR].map(|column| column as f32);
        assert_eq!(first, columns);
        assert_eq!(<[f32; ROW]>::from(row), numbers);
    }
}
