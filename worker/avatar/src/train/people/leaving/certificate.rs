//! The certificate of a removal.

use serde::{Deserialize, Serialize};

/// Version of [`Certificate`] that this program writes.
pub(super) const VERSION: u32 = 1;

/// What was removed with a person, and what may be left of them.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Certificate {
    /// Format version.
    pub version: u32,
    /// The person's slot.
    pub slot: usize,
    /// Steps of the checkpoint that they were removed from.
    pub step: u64,
    /// Whether the shared weights have learned from them. The file calls it `trunk`.
    #[serde(rename = "trunk")]
    pub shared_weights: SharedWeights,
    /// What was removed.
    pub removed: Removed,
    /// Number of traces of theirs that were searched for in the new files, and not found.
    pub searched: usize,
    /// SHA-256 of the new weights, hex.
    pub weights: String,
}

/// What the shared weights have learned from a person.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SharedWeights {
    /// Nothing: they joined when the weights were frozen, and nothing of them was ever in them.
    #[serde(rename = "private_only")]
    NeverSawThem,
    /// The weights were trained on their frames, and keep what they learned. Only a training of the others
    /// from the start has nothing of them.
    #[serde(rename = "trunk_saw_them")]
    SawThem,
}

/// What was removed.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Removed {
    /// Names of the tensors of their parameters.
    pub tensors: Vec<String>,
    /// Number of tensors of the optimiser.
    pub moments: usize,
    /// Whether there was an occupancy grid.
    pub occupancy: bool,
    /// Whether their poses were refined.
    pub refinement: bool,
    /// Whether exposures of their film were known.
    pub exposures: bool,
    /// Files that were left out whole: their pose track, and pictures of everybody.
    pub files: Vec<String>,
}

impl Certificate {
    /// Its meaning in words.
    pub fn says(&self) -> String {
        let Self { slot, searched, .. } = self;
        let shared = match self.shared_weights {
            SharedWeights::NeverSawThem => {
                "the shared part never saw them: nothing of them is left in this checkpoint"
            }
            SharedWeights::SawThem => {
                "the shared part was trained on them, and what it learned stays: only a training of the \
                 others from the start has nothing of them"
            }
        };
        format!(
            "slot {slot}: {} tensors, {} moments, {} files and what the state knew of them are gone, {searched} \
             traces were searched for and not found; {shared}",
            self.removed.tensors.len(),
            self.removed.moments,
            self.removed.files.len()
        )
    }
}
