//! Faults of cameras and poses, and the checks of numbers that find them.

/// Why a camera or a pose can't be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{field}: {message}")]
pub struct ViewError {
    /// The field at fault, named as in the message or file it came from.
    pub field: String,
    /// The fault, in words.
    pub message: String,
}

impl ViewError {
    pub(crate) fn new(field: impl Into<String>, message: impl Into<String>) -> Self {
        Self {
            field: field.into(),
            message: message.into(),
        }
    }
}

/// `values` as an array, or an error that says how many there should be.
pub(crate) fn fixed<const N: usize>(field: &str, values: &[f64]) -> Result<[f64; N], ViewError> {
    values
        .try_into()
        .map_err(|_| ViewError::new(field, format!("{} numbers, {N} are needed", values.len())))
}

/// Checks that every value is a number within ±`limit`; the error names the first that is not.
pub(crate) fn finite(field: &str, values: &[f64], limit: f64) -> Result<(), ViewError> {
    match values.iter().position(|v| v.is_nan() || v.abs() > limit) {
        None => Ok(()),
        Some(i) => Err(ViewError::new(
            format!("{field}[{i}]"),
            format!("{} is not a number within ±{limit}", values[i]),
        )),
    }
}
