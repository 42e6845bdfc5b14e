//! Resolves display names such as "ada" to resource names such as "subjects/01j…".

use super::{ClientError, YotoClient};
use yoto_proto::names::Collection;
use yoto_proto::v1::{Job, Model, Subject, subject};

impl YotoClient {
    /// The subject called `wanted`: a display name, a resource name, or the start of one or of its id.
    /// A subject without any capture does not count if another one has that display name.
    ///
    /// # Errors
    /// [`ClientError::Name`] when there is none, or more than one.
    pub async fn find_subject(&self, wanted: &str) -> Result<Subject, ClientError> {
        let mut subjects = self.list_subjects().await?;
        subjects.retain(|subject| subject.state() != subject::State::Erased);
        let filmed = |it: &Subject| it.display_name == wanted && !it.captures.is_empty();
        if subjects.iter().any(filmed) {
            subjects.retain(|it| it.display_name != wanted || !it.captures.is_empty());
        }
        let names = subjects
            .iter()
            .map(|subject| (subject.name.as_str(), subject.display_name.as_str()));
        let index = pick_name(Collection::Subjects, wanted, names)?;
        Ok(subjects.swap_remove(index))
    }

    /// The model called `wanted`: a display name, a resource name, or the start of one or of its id.
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

    /// The job called `wanted`: a resource name, or the start of one or of its id.
    ///
    /// # Errors
    /// [`ClientError::Name`] when there is none, or more than one.
    pub async fn find_job(&self, wanted: &str) -> Result<Job, ClientError> {
        let mut jobs = self.list_jobs().await?;
        let names = jobs.iter().map(|job| (job.name.as_str(), ""));
        let index = pick_name(Collection::Jobs, wanted, names)?;
        Ok(jobs.swap_remove(index))
    }
}

/// Fewest characters of the beginning of an id that are accepted for the id.
const SHORTEST_PREFIX: usize = 4;

/// The pair of (resource name, display name) that matches `wanted`: the name, the display name, or
/// else the start of the name or of its id.
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
    let mut matching: Vec<usize> = (0..candidates.len())
        .filter(|&i| !wanted.is_empty() && candidates[i].1 == wanted)
        .collect();
    if matching.is_empty() {
        let start = id_in(collection, wanted).unwrap_or(wanted);
        let begins =
            |&i: &usize| id_in(collection, candidates[i].0).is_some_and(|id| id.starts_with(start));
        if start.len() >= SHORTEST_PREFIX {
            matching = (0..candidates.len()).filter(begins).collect();
        }
    }
    let one = collection.as_str().trim_end_matches('s');
    match matching.as_slice() {
        [index] => Ok(*index),
        [] => {
            let known = match collection {
                // Their names say nothing to people.
                Collection::Jobs if wanted.len() < SHORTEST_PREFIX => {
                    format!("name it by at least the first {SHORTEST_PREFIX} characters of its id")
                }
                Collection::Jobs => "`yoto job list` lists them".to_owned(),
                _ => known(&candidates),
            };
            Err(ClientError::Name(format!(
                "no {one} is called '{wanted}' ({known})"
            )))
        }
        several => {
            let names: Vec<&str> = several.iter().map(|&index| candidates[index].0).collect();
            Err(ClientError::Name(format!(
                "{} {} {} '{wanted}'; say which: {}",
                names.len(),
                collection.as_str(),
                match candidates[several[0]].1 == wanted {
                    true => "are called",
                    false => "begin with",
                },
                names.join(", ")
            )))
        }
    }
}

/// The id in a resource name.
fn id_in(collection: Collection, name: &str) -> Option<&str> {
    name.strip_prefix(collection.as_str())?.strip_prefix('/')
}

/// The known display names, or resource names of what has none; of many, the first ones.
fn known(candidates: &[(&str, &str)]) -> String {
    let names: Vec<&str> = candidates
        .iter()
        .map(|(name, display)| if display.is_empty() { *name } else { *display })
        .take(20)
        .collect();
    let more = candidates.len() - names.len();
    match (names.is_empty(), more) {
        (true, _) => "there is none yet".to_owned(),
        (false, 0) => format!("known: {}", names.join(", ")),
        (false, more) => format!("known: {}, and {more} more", names.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KNOWN: [(&str, &str); 3] = [
        ("subjects/1a2b3", "ada"),
        ("subjects/2a2b3", "bob"),
        ("subjects/2a2c4", "bob"),
    ];

    fn pick(wanted: &str) -> Result<usize, String> {
        pick_name(Collection::Subjects, wanted, KNOWN).map_err(|error| error.to_string())
    }

    #[test]
    fn resource_names_and_unique_display_names_resolve() {
        assert_eq!(pick("ada"), Ok(0));
        assert_eq!(pick("subjects/2a2c4"), Ok(2));
        for start in ["1a2b", "subjects/1a2b"] {
            assert_eq!(pick(start), Ok(0), "{start}");
        }
        assert_eq!(pick("2a2c"), Ok(2));
    }

    #[test]
    fn unknown_and_shared_names_say_what_there_is() {
        assert_eq!(
            pick("eve"),
            Err("no subject is called 'eve' (known: ada, bob, bob)".into())
        );
        assert_eq!(
            pick("bob"),
            Err("2 subjects are called 'bob'; say which: subjects/2a2b3, subjects/2a2c4".into())
        );
        for short in ["", "1a", "subjects/", "models/1a2b"] {
            assert!(pick(short).is_err(), "{short}");
        }
        let link = pick_name(Collection::Shares, "eve", [("shares/1a2b3", "")]);
        assert_eq!(
            link.map_err(|error| error.to_string()),
            Err("no share is called 'eve' (known: shares/1a2b3)".into())
        );
        let none = pick_name(Collection::Models, "m", []).map_err(|error| error.to_string());
        assert_eq!(
            none,
            Err("no model is called 'm' (there is none yet)".into())
        );
    }
}
