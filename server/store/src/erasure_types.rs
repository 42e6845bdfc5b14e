//! Erasures in the interface of the store.

use super::StoreError;
use crate::Tenant;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use yoto_proto::v1::RemovedPerson;

/// An erasure that goes on.
#[derive(Debug, Clone)]
pub struct OpenErasure {
    /// Its id.
    pub id: String,
    /// The person's tenant.
    pub tenant: Tenant,
    /// The person's id.
    pub subject_id: String,
    /// What is still to be done, once the rows are gone: [`Work`] as JSON.
    pub work: Option<String>,
    /// Whether the others of models whose shared parameters have seen the person are trained anew.
    pub retrain: bool,
}

/// How far a model is that a person leaves.
#[derive(Debug, Clone)]
pub enum Leaving {
    /// No job of it needs to run any more.
    Done,
    /// `jobs/{id}` was queued now.
    Queued {
        /// The job.
        job: String,
    },
    /// `jobs/{id}` is open.
    Waits {
        /// The job.
        job: String,
    },
    /// `jobs/{id}` has ended without success.
    Failed {
        /// The job.
        job: String,
        /// For people.
        why: String,
    },
}

/// A report, and the signature over its bytes.
#[derive(Debug, Clone)]
pub struct SignedReport {
    /// The signed bytes.
    pub json: String,
    /// Ed25519, lower-case hex.
    pub signature: String,
    /// The key that verifies it, lower-case hex.
    pub public_key: String,
}

/// A column whose rows have something that was searched for.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Trace {
    /// The table.
    pub table: String,
    /// The column.
    pub column: String,
    /// Number of rows.
    pub rows: u64,
}

/// What an erasure has removed from the rows, and what it still has to remove from the store of objects. Kept in its row until it is done. It has the person's name, which the report has not.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Work {
    /// The person's name.
    pub name: String,
    /// Ids of the person and of all that was theirs.
    pub ids: Vec<String>,
    /// Ids of the jobs that were deleted.
    pub jobs: Vec<String>,
    /// Folders of the store to remove.
    pub folders: Vec<String>,
    /// Folders below which everything is removed that no row names.
    pub unnamed: Vec<String>,
    /// Numbers of removed rows, by kind.
    pub rows: BTreeMap<String, u64>,
    /// The models that the person was in.
    pub models: Vec<LeftModel>,
    /// Objects and bytes that are removed, by the first folder of their keys; none before they were counted.
    pub objects: Option<BTreeMap<String, Counted>>,
}

/// Objects, and their bytes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counted {
    /// How many.
    pub objects: u64,
    /// Their size.
    pub bytes: u64,
}

/// A model that the person was taken out of.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeftModel {
    /// `models/{id}`.
    pub model: String,
    /// The slot, which is never used again.
    pub slot: u32,
    /// What the parameters that all share have of the person.
    pub shared_weights: SharedWeights,
    /// `models/{id}` of the others, trained from scratch without the person; none where that was not asked for, or is not needed.
    #[serde(default)]
    pub retrained: Option<String>,
    /// Checkpoints that were written anew.
    pub checkpoints_rewritten: u64,
    /// Checkpoints that were deleted, because nobody else was in them or they were damaged.
    pub checkpoints_deleted: u64,
    /// Tensors of the person in all checkpoints.
    pub tensors: u64,
    /// Tensors of the optimiser.
    pub moments: u64,
    /// Files that were left out.
    pub files: u64,
    /// Traces that were searched for in the new files, and not found.
    pub traces_searched: u64,
    /// SHA-256 of the new weights, by step.
    pub weights_sha256: BTreeMap<u64, String>,
}

/// What the parameters that all people of a model share have learned from one of them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SharedWeights {
    /// Nothing: the person was in no checkpoint, or joined when they were frozen.
    #[default]
    NeverSawThem,
    /// They were trained on the person's frames. What they learned stays until a new model is trained without the person.
    SawThem,
    /// They are gone with the checkpoints, which had nobody else.
    Deleted,
}

impl Work {
    /// Counts `rows` removed rows of this kind.
    pub fn count(&mut self, kind: &str, rows: u64) {
        *self.rows.entry(kind.to_owned()).or_default() += rows;
    }

    /// As it is kept.
    ///
    /// # Errors
    /// When it can't be written as JSON.
    pub fn to_json(&self) -> Result<String, StoreError> {
        serde_json::to_string(self).map_err(unreadable)
    }

    /// As it was kept.
    ///
    /// # Errors
    /// When it was altered.
    pub fn of_json(text: &str) -> Result<Self, StoreError> {
        serde_json::from_str(text).map_err(unreadable)
    }
}

impl LeftModel {
    /// Adds what the model's job has written anew.
    pub fn note(&mut self, removed: &[RemovedPerson]) {
        for it in removed {
            self.checkpoints_rewritten += 1;
            self.tensors += u64::from(it.tensors);
            self.moments += u64::from(it.moments);
            self.files += u64::from(it.files);
            self.traces_searched += u64::from(it.searched);
            let weights = it.weights_sha256.clone();
            self.weights_sha256.insert(it.step, weights);
        }
    }
}

fn unreadable(error: serde_json::Error) -> StoreError {
    StoreError::Corrupt {
        what: "erasures.work",
        detail: error.to_string(),
    }
}
