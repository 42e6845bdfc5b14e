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
    /// Uploads of recordings.
    Uploads,
    /// Shared networks.
    Models,
    /// Jobs.
    Jobs,
    /// Processes that run jobs.
    Workers,
    /// Keys of callers.
    Keys,
    /// What people have agreed to.
    Consents,
    /// Removals of people.
    Erasures,
    /// Links to pages.
    Shares,
    /// Addresses that are told when jobs end.
    Webhooks,
}

impl Collection {
    /// All collections.
    pub const ALL: [Self; 11] = [
        Self::Subjects,
        Self::Captures,
        Self::Uploads,
        Self::Models,
        Self::Jobs,
        Self::Workers,
        Self::Keys,
        Self::Consents,
        Self::Erasures,
        Self::Shares,
        Self::Webhooks,
    ];

    /// The collection's segment in a name.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Subjects => "subjects",
            Self::Captures => "captures",
            Self::Uploads => "uploads",
            Self::Models => "models",
            Self::Jobs => "jobs",
            Self::Workers => "workers",
            Self::Keys => "keys",
            Self::Consents => "consents",
            Self::Erasures => "erasures",
            Self::Shares => "shares",
            Self::Webhooks => "webhooks",
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

/// Invalid resource name.
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

/// The model's id and the step in `models/{id}/checkpoints/{step}`.
///
/// # Errors
/// When `name` is not of that form.
pub fn parse_checkpoint(name: &str) -> Result<(&str, u64), NameError> {
    let error = || NameError {
        collection: "models/{id}/checkpoints",
        name: name.chars().take(80).collect(),
    };
    let (model, step) = name.split_once("/checkpoints/").ok_or_else(error)?;
    let id = Collection::Models.parse(model).map_err(|_| error())?;
    // `+5` and `05` are numbers, but not canonical names.
    let step: u64 = step.parse().map_err(|_| error())?;
    (name == checkpoint(model, step))
        .then_some((id, step))
        .ok_or_else(error)
}

/// `{parent}/objects/{file}`.
pub fn object(parent: &str, file: &str) -> String {
    format!("{parent}/objects/{file}")
}

/// Parent and file in `{parent}/objects/{file}`. Neither is checked.
///
/// # Errors
/// When `name` is not of that form.
pub fn parse_object(name: &str) -> Result<(&str, &str), NameError> {
    name.split_once("/objects/").ok_or_else(|| NameError {
        collection: "{parent}/objects",
        name: name.chars().take(80).collect(),
    })
}

/// Whether `text` has the form of a resource's name; of an object, whether its parent has it.
pub fn is_name(text: &str) -> bool {
    let parent = parse_object(text).map_or(text, |(parent, _)| parent);
    let of_collection = || Collection::ALL.iter().any(|it| it.parse(parent).is_ok());
    parse_checkpoint(parent).is_ok() || of_collection()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_told_from_other_texts() {
        for name in [
            "subjects/8d0e",
            "jobs/1",
            "models/m/checkpoints/40",
            "models/m/checkpoints/40/objects/weights.safetensors",
            "jobs/1/objects/000000.png",
        ] {
            assert!(is_name(name), "{name}");
        }
        for text in [
            "",
            "Ada",
            "subjects/",
            "subjects/Ada Lovelace",
            "people/1",
            "jobs/1/2",
        ] {
            assert!(!is_name(text), "{text}");
        }
    }

    #[test]
    fn a_checkpoint_is_named_in_one_way() {
        let name = checkpoint("models/a-1", 40);
        assert_eq!(parse_checkpoint(&name), Ok(("a-1", 40)));
        for bad in [
            "models/a/checkpoints/",
            "models/a/checkpoints/+5",
            "models/a/checkpoints/05",
            "models/a/checkpoints/5/x",
            "jobs/a/checkpoints/5",
            "models//checkpoints/5",
            "models/a",
        ] {
            assert!(parse_checkpoint(bad).is_err(), "{bad}");
        }
    }

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
