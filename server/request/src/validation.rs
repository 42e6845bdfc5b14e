//! Faults of a request: all of them are answered at once, as far as there is room.

use crate::RequestError;
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

/// One error with the faults of both: those of fields come first, since no change of the catalogue mends them. An error of the
/// service comes alone.
fn joined(first: RequestError, second: RequestError) -> RequestError {
    if !first.is_fault() {
        return first;
    }
    if !second.is_fault() {
        return second;
    }
    let mut fields: Option<FieldFaults> = None;
    let mut others: Vec<RequestError> = Vec::new();
    for error in parts(first).into_iter().chain(parts(second)) {
        match (error, &mut fields) {
            (RequestError::Invalid(more), Some(fields)) => fields.extend(more),
            (RequestError::Invalid(more), None) => fields = Some(more),
            // One person without a capture may be needed in many places.
            (error, _) => {
                let text = error.to_string();
                if others.len() < VIOLATIONS && others.iter().all(|it| it.to_string() != text) {
                    others.push(error);
                }
            }
        }
    }
    let fields = fields.map(RequestError::Invalid);
    let all: Vec<_> = fields.into_iter().chain(others).collect();
    match <[RequestError; 1]>::try_from(all) {
        Ok([one]) => one,
        Err(several) => RequestError::Several(several),
    }
}

fn parts(error: RequestError) -> Vec<RequestError> {
    match error {
        RequestError::Several(errors) => errors,
        error => vec![error],
    }
}

/// Both values, or the faults of both. An error of the service comes first.
///
/// # Errors
/// Those of the two results.
pub fn both<A, B>(
    first: Result<A, RequestError>,
    second: Result<B, RequestError>,
) -> Result<(A, B), RequestError> {
    match (first, second) {
        (Ok(first), Ok(second)) => Ok((first, second)),
        (Ok(_), Err(error)) | (Err(error), Ok(_)) => Err(error),
        (Err(first), Err(second)) => Err(joined(first, second)),
    }
}

/// All values, or the faults of all. The first error of the service ends the search.
///
/// # Errors
/// Those of the results.
pub fn all<T>(
    results: impl IntoIterator<Item = Result<T, RequestError>>,
) -> Result<Vec<T>, RequestError> {
    let mut values = Vec::new();
    let mut found = None;
    for result in results {
        match (result, found.take()) {
            (Ok(value), before) => {
                values.push(value);
                found = before;
            }
            (Err(error), _) if !error.is_fault() => return Err(error),
            (Err(error), None) => found = Some(error),
            (Err(error), Some(before)) => found = Some(joined(before, error)),
        }
    }
    match found {
        Some(error) => Err(error),
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
        let gone = |name: &str| {
            Err::<u8, _>(RequestError::NotFound {
                name: name.to_owned(),
            })
        };
        let found = both(both(gone("a"), bad::<u8>("b")), all([gone("c"), gone("a")]));
        let Err(RequestError::Several(errors)) = found else {
            panic!("{found:?}");
        };
        let texts: Vec<_> = errors.iter().map(ToString::to_string).collect();
        assert_eq!(texts, ["b: is bad", "a does not exist", "c does not exist"]);
        let other = both::<u8, u8>(bad("a"), Err(RequestError::ShuttingDown));
        assert!(matches!(other, Err(RequestError::ShuttingDown)));
    }
}
