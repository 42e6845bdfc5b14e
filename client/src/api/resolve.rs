//! Resolves display names such as "ada" to resource names such as "subjects/01j…".

use super::{ClientError, YotoClient};
use yoto_proto::names::Collection;
use yoto_proto::v1::{Model, Subject, subject};

impl YotoClient {
    /// The subject called `wanted`: a resource name or a display name.
    ///
    /// # Errors
    /// [`ClientError::Name`] when there is none, or more than one.
    pub async fn find_subject(&self, wanted: &str) -> Result<Subject, ClientError> {
        let mut subjects = self.list_subjects().await?;
        subjects.retain(|subject| subject.state() != subject::State::Erased);
        let names = subjects
            .iter()
            .map(|subject| (subject.name.as_str(), subject.display_name.as_str()));
        let index = pick_name(Collection::Subjects, wanted, names)?;
        Ok(subjects.swap_remove(index))
    }

    /// The model called `wanted`: a resource name or a display name.
    ///
    /// # Errors
    /// [`ClientError::Name`] when there is none, or more than one.
    pub async fn find_model(&self, wanted: &str) -> Result<Model, ClientError> {
        let mut models = self.list_models().await?;
        let names = models
            .iter()
            .map(|model| (model.name.as_str(), model.display_name.as_str()));
        let index = pick_name(Collection::Models, wanted, names)?;
        Ok(models.swap_remove(index))
    }
}

/// The pair of (resource name, display name) that matches `wanted`.
///
/// # Errors
/// [`ClientError::Name`], with all known names, or with all matching resource names.
pub fn pick_name<'a>(
    collection: Collection,
    wanted: &str,
    candidates: impl IntoIterator<Item = (&'a str, &'a str)>,
) -> Result<usize, ClientError> {
    let candidates: Vec<(&str, &str)> = candidates.into_iter().collect();
    if let Some(index) = candidates.iter().position(|(name, _)| *name == wanted) {
        return Ok(index);
    }
    let matching: Vec<usize> = (0..candidates.len())
        .filter(|&i| candidates[i].1 == wanted)
        .collect();
    let one = collection.as_str().trim_end_matches('s');
    match matching.as_slice() {
        [index] => Ok(*index),
        [] => {
            let known: Vec<&str> = candidates
                .iter()
                .take(20)
                .map(|(_, display)| *display)
                .collect();
            let known = if known.is_empty() {
                "there is none yet".to_owned()
            } else {
                format!("known: {}", known.join(", "))
            };
            Err(ClientError::Name(format!(
                "no {one} is called '{wanted}' ({known})"
            )))
        }
        several => {
            let names: Vec<&str> = several.iter().map(|&index| candidates[index].0).collect();
            Err(ClientError::Name(format!(
                "{} {} are called '{wanted}'; say which: {}",
                names.len(),
                collection.as_str(),
                names.join(", ")
            )))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KNOWN: [(&str, &str); 3] = [
        ("subjects/1", "ada"),
        ("subjects/2", "bob"),
        ("subjects/3", "bob"),
    ];

    fn pick(wanted: &str) -> Result<usize, String> {
        pick_name(Collection::Subjects, wanted, KNOWN).map_err(|error| error.to_string())
    }

    #[test]
    fn resource_names_and_unique_display_names_resolve() {
        assert_eq!(pick("ada"), Ok(0));
        assert_eq!(pick("subjects/3"), Ok(2));
    }

    #[test]
    fn unknown_and_shared_names_say_what_there_is() {
        assert_eq!(
            pick("eve"),
            Err("no subject is called 'eve' (known: ada, bob, bob)".into())
        );
        assert_eq!(
            pick("bob"),
            Err("2 subjects are called 'bob'; say which: subjects/2, subjects/3".into())
        );
        let none = pick_name(Collection::Models, "m", []).map_err(|error| error.to_string());
        assert_eq!(
            none,
            Err("no model is called 'm' (there is none yet)".into())
        );
    }
}
