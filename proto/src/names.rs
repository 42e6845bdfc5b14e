//! Typed resource names: `subjects/{id}`, `jobs/{id}`, …
//!
//! A name of the wrong collection must never reach a database query, so each collection
//! has one parser and ids are limited to a harmless alphabet.

use thiserror::Error;

/// The collections of the API.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Collection {
    /// People.
    Subjects,
    /// Recordings of people.
    Captures,
    /// Shared networks.
    Models,
    /// Work.
    Jobs,
    /// Processes that do the work.
    Workers,
}

impl Collection {
    /// The collection's segment in a name.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Subjects => "subjects",
            Self::Captures => "captures",
            Self::Models => "models",
            Self::Jobs => "jobs",
            Self::Workers => "workers",
        }
    }

    /// `subjects/{id}`.
    pub fn name(self, id: &str) -> String {
        format!("{}/{id}", self.as_str())
    }

    /// The id in `name`.
    ///
    /// # Errors
    /// When `name` is of another collection, or its id is not 1 to 64 of `[a-z0-9-]`.
    pub fn parse(self, name: &str) -> Result<&str, NameError> {
        let error = || NameError {
            collection: self.as_str(),
            name: name.chars().take(80).collect(),
        };
        let id = name
            .strip_prefix(self.as_str())
            .and_then(|rest| rest.strip_prefix('/'))
            .ok_or_else(error)?;
        let valid = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-';
        if id.is_empty() || id.len() > 64 || !id.bytes().all(valid) {
            return Err(error());
        }
        Ok(id)
    }
}

/// A resource name that is not one.
#[derive(Debug, Error, PartialEq, Eq)]
#[error("'{name}' is not a resource name of the form {collection}/{{id}}")]
pub struct NameError {
    collection: &'static str,
    name: String,
}

/// `models/{id}/checkpoints/{step}`.
pub fn checkpoint(model: &str, step: u64) -> String {
    format!("{model}/checkpoints/{step}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parses_its_own_names_and_no_others() {
        assert_eq!(
            Collection::Jobs.parse(&Collection::Jobs.name("a-1")),
            Ok("a-1")
        );
        for bad in [
            "jobs/",
            "jobs",
            "subjects/a",
            "jobs/a/b",
            "jobs/A",
            "jobs/../x",
            "",
            "jobs/ü",
        ] {
            assert!(Collection::Jobs.parse(bad).is_err(), "{bad}");
        }
    }
}
