//! The checkpoint manifest: the objects of a checkpoint, each with its checksum.
//!
//! It is written after the data objects and before the database row, so that a checkpoint
//! is either complete or detectably incomplete.

use serde::{Deserialize, Serialize};

/// Version written by this program.
pub const VERSION: u32 = 1;

/// Names of the data objects inside a checkpoint's folder.
pub mod files {
    /// Network weights; enough for rendering.
    pub const WEIGHTS: &str = "weights.safetensors";
    /// Adam moments; needed only to resume training.
    pub const OPTIMISER: &str = "optimiser.bpk";
    /// Occupancy of each identity's canonical space; speeds up rendering and training.
    /// Checkpoints may lack it.
    pub const OCCUPANCY: &str = "occupancy.safetensors";
    /// Refined poses of the training frames; needed only to resume a training that refines them.
    /// Other checkpoints lack it.
    pub const REFINEMENT: &str = "refinement.json";
    /// Exposures of the training frames, where they are learned; needed to resume such a training, and to measure
    /// on frames of the same film.
    pub const EXPOSURES: &str = "exposures.json";
    /// Pose track of the person in `slot` with the poses that training has refined, in protocol
    /// buffers; absent where their poses stay as given.
    pub fn refined_poses(slot: usize) -> String {
        format!("poses-{slot}.pb")
    }

    /// Whether `file` is one of [`refined_poses`].
    pub fn is_refined_poses(file: &str) -> bool {
        refined_by(file).is_some()
    }

    /// The slot of the person whose [`refined_poses`] the `file` has. A slot has one name: `poses-07.pb` is of none.
    pub fn refined_by(file: &str) -> Option<usize> {
        let slot = file.strip_prefix("poses-")?.strip_suffix(".pb")?;
        let slot = slot.parse().ok()?;
        (refined_poses(slot) == file).then_some(slot)
    }

    /// A held-out frame of each person beside its render, for people; a checkpoint of an interrupted
    /// training lacks it.
    pub const PREVIEW: &str = "preview.png";
    /// Configuration, step and schedule state as JSON.
    pub const STATE: &str = "state.json";
    /// The manifest itself.
    pub const MANIFEST: &str = "manifest.json";
}

/// `manifest.json` of a checkpoint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// [`VERSION`].
    pub version: u32,
    /// `models/{id}`.
    pub model: String,
    /// Training steps taken.
    pub step: u64,
    /// `jobs/{id}` that saved it: the same job, leased again, continues its budget; another
    /// job has its own.
    #[serde(default)]
    pub job: String,
    /// Seconds of that job's training, over all its leases.
    #[serde(default)]
    pub job_seconds: f64,
    /// Steps of that job, over all its leases.
    #[serde(default)]
    pub job_steps: u64,
    /// The data objects.
    pub objects: Vec<ManifestObject>,
}

/// One data object of a checkpoint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ManifestObject {
    /// One of [`files`].
    pub file: String,
    /// Key in the object store.
    pub key: String,
    /// Size.
    pub bytes: u64,
    /// Lower-case hex.
    pub sha256: String,
}

impl Manifest {
    /// Reads a `manifest.json`.
    ///
    /// # Errors
    /// Something else than a manifest.
    pub fn from_json(bytes: &[u8]) -> serde_json::Result<Self> {
        serde_json::from_slice(bytes)
    }

    /// The object of `file`, if the checkpoint has it.
    pub fn object(&self, file: &str) -> Option<&ManifestObject> {
        self.objects.iter().find(|object| object.file == file)
    }

    /// Bytes of all data objects. Sizes that a manifest only claims may be beyond any sum.
    pub fn bytes(&self) -> u64 {
        let sizes = self.objects.iter().map(|object| object.bytes);
        sizes.fold(0, u64::saturating_add)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slot_has_one_name() {
        assert_eq!(files::refined_by(&files::refined_poses(12)), Some(12));
        for other in ["poses-+7.pb", "poses-07.pb", "poses-.pb", "poses-7.json"] {
            assert_eq!(files::refined_by(other), None, "{other}");
        }
    }

    #[test]
    fn sizes_beyond_any_sum_are_the_largest() {
        let object = |bytes| ManifestObject {
            file: files::WEIGHTS.into(),
            key: String::new(),
            bytes,
            sha256: String::new(),
        };
        let manifest = Manifest {
            version: VERSION,
            model: String::new(),
            step: 0,
            job: String::new(),
            job_seconds: 0.0,
            job_steps: 0,
            objects: vec![object(u64::MAX), object(1)],
        };
        assert_eq!(manifest.bytes(), u64::MAX);
    }
}
