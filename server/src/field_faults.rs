//! Faults of a request's fields: all of them are answered at once, as far as there is room.

use crate::error::RequestError;
use std::fmt;
use yoto_proto::limits::VIOLATIONS;

/// A fault of one field.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FieldFault {
    /// Path of the field in the request.
    pub field: String,
    /// The fault.
    pub message: String,
}

/// The faults of a request, at least one.
#[derive(Debug)]
pub struct FieldFaults {
    /// The first ones, at most [`VIOLATIONS`].
    pub kept: Vec<FieldFault>,
    /// Number of all.
    pub count: usize,
}

impl FieldFaults {
    /// One fault.
    pub fn one(field: String, message: String) -> Self {
        Self {
            kept: vec![FieldFault { field, message }],
            count: 1,
        }
    }

    /// Adds the faults of other fields.
    pub fn extend(&mut self, others: Self) {
        self.count += others.count;
        let room = VIOLATIONS.saturating_sub(self.kept.len());
        self.kept.extend(others.kept.into_iter().take(room));
    }
}

/// The first fault, and the number of further ones.
impl fmt::Display for FieldFaults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(FieldFault { field, message }) = self.kept.first() {
            write!(f, "{field}: {message}")?;
        }
        match self.count {
            0 | 1 => Ok(()),
            2 => write!(f, "; and 1 more fault"),
            count => write!(f, "; and {} more faults", count - 1),
        }
    }
}

/// Both values, or the faults of both. An error of another kind comes first.
///
/// # Errors
/// Those of the two results.
pub fn both<A, B>(
    first: Result<A, RequestError>,
    second: Result<B, RequestError>,
) -> Result<(A, B), RequestError> {
    match (first, second) {
        (Ok(first), Ok(second)) => Ok((first, second)),
        (Err(RequestError::Invalid(mut faults)), Err(RequestError::Invalid(others))) => {
            faults.extend(others);
            Err(RequestError::Invalid(faults))
        }
        (Err(RequestError::Invalid(_)), Err(other)) | (Ok(_), Err(other)) | (Err(other), _) => {
            Err(other)
        }
    }
}

/// All values, or the faults of all. The first error of another kind ends the search.
///
/// # Errors
/// Those of the results.
pub fn all<T>(
    results: impl IntoIterator<Item = Result<T, RequestError>>,
) -> Result<Vec<T>, RequestError> {
    let mut values = Vec::new();
    let mut faults: Option<FieldFaults> = None;
    for result in results {
        match (result, &mut faults) {
            (Ok(value), _) => values.push(value),
            (Err(RequestError::Invalid(others)), Some(faults)) => faults.extend(others),
            (Err(RequestError::Invalid(others)), None) => faults = Some(others),
            (Err(other), _) => return Err(other),
        }
    }
    match faults {
        Some(faults) => Err(RequestError::Invalid(faults)),
        None => Ok(values),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bad<T>(field: &str) -> Result<T, RequestError> {
        Err(RequestError::invalid(field, "is bad"))
    }

    #[test]
    fn faults_are_counted_and_the_first_ones_kept() {
        let found = both::<u8, Vec<u8>>(bad("a"), all((0..500).map(|_| bad("b"))));
        let Err(RequestError::Invalid(faults)) = found else {
            panic!("{found:?}");
        };
        assert_eq!((faults.count, faults.kept.len()), (501, VIOLATIONS));
        assert_eq!(faults.to_string(), "a: is bad; and 500 more faults");
        assert_eq!(both(Ok(1), Ok(2)).expect("is good"), (1, 2));
        let other = both::<u8, u8>(bad("a"), Err(RequestError::ShuttingDown));
        assert!(matches!(other, Err(RequestError::ShuttingDown)));
    }
}
