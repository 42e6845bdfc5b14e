//! The report of an erasure, without the person's name.

use serde::Serialize;
use std::collections::BTreeMap;
use yoto_store::{Counted, LeftModel, SharedWeights, StoreError, Trace, Work};

/// Version of [`Report`] that this program writes.
const VERSION: u32 = 1;

/// What was removed, and what was searched for afterwards.
#[derive(Debug, Serialize)]
pub(super) struct Report<'a> {
    version: u32,
    /// `erasures/{id}`.
    erasure: &'a str,
    /// `subjects/{id}`.
    subject: &'a str,
    name_sha256: &'a str,
    /// Removed rows by kind.
    rows: &'a BTreeMap<String, u64>,
    /// Removed objects by the first folder of their keys.
    objects: &'a BTreeMap<String, Counted>,
    models: &'a [LeftModel],
    search: Search<'a>,
    says: Vec<String>,
}

/// What was searched for after the removal.
#[derive(Debug, Serialize)]
pub(super) struct Search<'a> {
    /// Folders of the store that were listed.
    pub folders: usize,
    /// Objects that are still in them.
    pub objects_left: u64,
    /// Columns of the database with an id of the person or of something that was theirs.
    pub ids_left: &'a [Trace],
    /// Columns with the person's name, which can be a word in a text of somebody else.
    pub names_left: &'a [Trace],
}

impl<'a> Report<'a> {
    /// The report of an erasure that has removed what `work` says.
    pub(super) fn new(
        (erasure, subject, name_sha256): (&'a str, &'a str, &'a str),
        work: &'a Work,
        objects: &'a BTreeMap<String, Counted>,
        search: Search<'a>,
    ) -> Self {
        Self {
            version: VERSION,
            erasure,
            subject,
            name_sha256,
            rows: &work.rows,
            objects,
            models: &work.models,
            says: says(&work.models, &search),
            search,
        }
    }

    /// The bytes that are signed.
    ///
    /// # Errors
    /// When it can't be written as JSON.
    pub(super) fn to_json(&self) -> Result<String, StoreError> {
        serde_json::to_string_pretty(self).map_err(|error| StoreError::Corrupt {
            what: "erasures.report",
            detail: error.to_string(),
        })
    }
}

/// What the report means, for people.
fn says(models: &[LeftModel], search: &Search<'_>) -> Vec<String> {
    let mut said: Vec<String> = models.iter().map(of_model).collect();
    said.push(match (search.objects_left, search.ids_left.len()) {
        (0, 0) => "nothing was found of them in the rows and folders that were searched".to_owned(),
        (objects, columns) => {
            format!("{objects} objects and {columns} columns still have something of them")
        }
    });
    if !search.names_left.is_empty() {
        said.push("their name is a word in texts of others: names_left has the columns".to_owned());
    }
    said
}

fn of_model(left: &LeftModel) -> String {
    let model = &left.model;
    match left.shared_weights {
        SharedWeights::NeverSawThem => {
            format!("{model}: the shared weights never saw them, and nothing of them is left in it")
        }
        SharedWeights::Deleted => {
            format!("{model}: nobody else was in its checkpoints, which are deleted")
        }
        SharedWeights::SawThem => {
            let stays = format!(
                "{model}: the shared weights were trained on them, and what they learned stays"
            );
            match &left.retrained {
                Some(new) => format!(
                    "{stays} until the model is deleted; {new} is trained from scratch on the others, and has nothing of them"
                ),
                None => format!(
                    "{stays}: only a new model, trained with `yoto train` on the others, has nothing of them"
                ),
            }
        }
    }
}
