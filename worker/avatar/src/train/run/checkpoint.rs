//! Checkpoints: weights, optimiser, state and occupancy, each in its own file. Rendering needs
//! only weights and state.

use crate::avatar::Avatar;
use crate::config::ModelConfig;
use crate::field::splats::{frozen_path, skinning_paths};
use crate::identity::stored_names::stored;
use crate::identity::{own, stored_names};
use crate::motion::body::CanonicalBody;
use crate::motion::prior::canonical_grid;
use crate::render::Renderer;
use crate::render::occupancy::Occupancy;
use crate::train::TrainError;
use crate::train::frames::order::PersonSteps;
use crate::train::run::optimiser_file;
use burn::optim::ModuleOptimizer;
use burn::store::{ModuleSnapshot, SafetensorsStore};
use burn::tensor::Device;
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use yoto_capture::skeleton::Skeleton;
use yoto_capture::skeleton::smpl::joints_of_body;
use yoto_proto::manifest::files;

/// Version of [`ModelState`] that this program reads and writes.
const VERSION: u32 = 2;

/// `state.json`: everything that is not a tensor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ModelState {
    /// Format version.
    pub version: u32,
    /// Configuration of the model.
    pub config: ModelConfig,
    /// Number of joints of each skeleton.
    pub joints: usize,
    /// Seed of the initial weights and of all random draws since.
    pub seed: u64,
    /// Steps taken over the model's life.
    pub step: u64,
    /// Completed fraction of a run, 0 to 1, which determines the active parts of the model. It does
    /// not decrease when another run continues with the model. Files call it `progress`.
    #[serde(rename = "progress")]
    pub schedule_progress: f64,
    /// Seconds spent in steps over the model's life.
    pub train_seconds: f64,
    /// The guard's factor on the learning rate.
    pub rate_scale: f64,
    /// Steps skipped because loss or gradients were not finite.
    pub skipped_steps: u64,
    /// Returns to an earlier state.
    pub rollbacks: u64,
    /// Whether the current budget continues with a model that was trained with the same people before. Files call
    /// it `goes_on`.
    #[serde(default, rename = "goes_on")]
    pub continues: bool,
    /// Slots of people whose training changed only their own parameters: the shared weights were already trained.
    #[serde(default, skip_serializing_if = "BTreeSet::is_empty")]
    pub own_only: BTreeSet<usize>,
    /// The steps with the person in each slot. Files call it `practice`.
    #[serde(default, rename = "practice")]
    pub steps_per_person: Vec<PersonSteps>,
    /// Slots of people who were removed.
    #[serde(default, skip_serializing_if = "BTreeSet::is_empty")]
    pub erased: BTreeSet<usize>,
    /// The decoder by which the last training of the person in a slot guessed what no frame shows: whose it is, and its digest. A slot
    /// has no entry if no decoder was used.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub priors: BTreeMap<usize, String>,
    /// Skeleton of each slot.
    pub slots: Vec<Option<Skeleton>>,
}

/// The part of `state.json` that all versions share.
#[derive(Deserialize)]
struct Versioned {
    version: u32,
}

fn failed(path: &Path, error: impl std::fmt::Display) -> TrainError {
    TrainError::File {
        file: path.display().to_string(),
        message: error.to_string(),
    }
}

impl ModelState {
    /// State of an untrained model.
    pub(crate) fn new(
        config: ModelConfig,
        joints: usize,
        seed: u64,
        slots: Vec<Option<Skeleton>>,
    ) -> Self {
        Self {
            version: VERSION,
            config,
            joints,
            seed,
            step: 0,
            schedule_progress: 0.0,
            train_seconds: 0.0,
            rate_scale: 1.0,
            skipped_steps: 0,
            rollbacks: 0,
            continues: false,
            own_only: BTreeSet::new(),
            steps_per_person: Vec::new(),
            erased: BTreeSet::new(),
            priors: BTreeMap::new(),
            slots,
        }
    }

    /// Reads `state.json` of a checkpoint's folder.
    ///
    /// # Errors
    /// If it is missing, invalid, or of another version.
    pub fn read(dir: &Path) -> Result<Self, TrainError> {
        let path = dir.join(files::STATE);
        let bytes = std::fs::read(&path).map_err(|e| failed(&path, e))?;
        // The version is read first: files of other versions may lack all other fields.
        let Versioned { version } = serde_json::from_slice(&bytes).map_err(|e| failed(&path, e))?;
        if version != VERSION {
            return Err(failed(
                &path,
                format!("version {version}, this program reads {VERSION}"),
            ));
        }
        let state: Self = serde_json::from_slice(&bytes).map_err(|e| failed(&path, e))?;
        state.config.check()?;
        state.check_skeletons().map_err(|e| failed(&path, e))?;
        Ok(state)
    }

    /// The number of joints of the person in `slot`, fingers counted, if the model knows somebody there.
    pub(crate) fn joints_of(&self, slot: usize) -> Option<usize> {
        let skeleton = self.slots.get(slot).and_then(Option::as_ref);
        skeleton.map(Skeleton::joints)
    }

    /// Checks that every skeleton is valid and has `joints` joints, fingers not counted.
    fn check_skeletons(&self) -> Result<(), String> {
        if self.joints < 2 {
            return Err(format!("joints: {}, at least 2 are needed", self.joints));
        }
        for (slot, skeleton) in self.slots.iter().enumerate() {
            let Some(skeleton) = skeleton else { continue };
            Skeleton::from_track(&skeleton.to_track())
                .map_err(|error| format!("slots[{slot}]: {error}"))?;
            let joints = joints_of_body(skeleton);
            if joints != self.joints {
                return Err(format!(
                    "slots[{slot}]: {joints} joints, expected {}",
                    self.joints
                ));
            }
        }
        Ok(())
    }
}

/// Writes the occupancy grid of each slot that has one: its levels, a tensor `[z, y, x]` of bytes
/// named after the slot, and its reach, `[1]`, metres.
pub(crate) fn save_occupancy(
    dir: &Path,
    occupancy: &[Option<Occupancy>],
) -> Result<(), TrainError> {
    let path = dir.join(files::OCCUPANCY);
    let mut tensors = Vec::new();
    for (slot, grid) in occupancy.iter().enumerate() {
        if let Some(grid) = grid {
            let [x, y, z] = grid.cells();
            let view = TensorView::new(Dtype::U8, vec![z, y, x], grid.levels());
            tensors.push((slot.to_string(), view.map_err(|e| failed(&path, e))?));
        }
    }
    let reaches: Vec<(usize, [u8; 4])> = (0..)
        .zip(occupancy)
        .filter_map(|(slot, grid)| Some((slot, grid.as_ref()?.reach().to_le_bytes())))
        .collect();
    for (slot, bytes) in &reaches {
        let view = TensorView::new(Dtype::F32, vec![1], bytes);
        tensors.push((reach_of(*slot), view.map_err(|e| failed(&path, e))?));
    }
    let bytes = safetensors::serialize(tensors, None).map_err(|e| failed(&path, e))?;
    std::fs::write(&path, bytes).map_err(|e| failed(&path, e))
}

/// Name of the tensor with the reach of a slot's grid.
fn reach_of(slot: usize) -> String {
    format!("{slot}.reach")
}

/// The grid of each slot of `state`. Slots without levels in the file, and all slots of a
/// checkpoint without the file, get grids without visited cells.
pub(crate) fn load_occupancy(
    dir: &Path,
    state: &ModelState,
) -> Result<Vec<Option<Occupancy>>, TrainError> {
    let path = dir.join(files::OCCUPANCY);
    let bytes = match std::fs::read(&path) {
        Ok(bytes) => Some(bytes),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => None,
        Err(error) => return Err(failed(&path, error)),
    };
    let file = bytes
        .as_ref()
        .map(|bytes| SafeTensors::deserialize(bytes))
        .transpose()
        .map_err(|e| failed(&path, e))?;
    let Some(march) = state.config.appearance.march() else {
        return Ok(vec![None; state.slots.len()]);
    };
    let grid = |(slot, skeleton): (usize, &Option<Skeleton>)| {
        let Some(skeleton) = skeleton else {
            return Ok(None);
        };
        let box_grid = canonical_grid(
            skeleton,
            state.config.motion.resolution.nodes(),
            state.config.box_epsilon(),
        );
        let Some(blank) = Occupancy::new(&box_grid, march) else {
            return Ok(None);
        };
        let name = slot.to_string();
        let Some(tensor) = file.as_ref().and_then(|file| file.tensor(&name).ok()) else {
            return Ok(Some(blank));
        };
        let [x, y, z] = blank.cells();
        if tensor.dtype() != Dtype::U8 || tensor.shape() != [z, y, x] {
            return Err(failed(
                &path,
                format!(
                    "slot {slot}: {:?} {:?}, its skeleton's grid is U8 [{z}, {y}, {x}]",
                    tensor.dtype(),
                    tensor.shape()
                ),
            ));
        }
        let name = reach_of(slot);
        let reach = file.as_ref().and_then(|file| file.tensor(&name).ok());
        let reach = reach.and_then(|reach| Some(f32::from_le_bytes(reach.data().try_into().ok()?)));
        let grid = reach.and_then(|reach| blank.with_learned(tensor.data(), reach));
        grid.map(Some)
            .ok_or_else(|| failed(&path, format!("{name}: not a length in metres")))
    };
    state.slots.iter().enumerate().map(grid).collect()
}

/// Writes the optimiser, weights and state of a checkpoint into `dir`.
pub(crate) fn save(
    dir: &Path,
    state: &ModelState,
    avatar: &Avatar,
    optimiser: &ModuleOptimizer,
) -> Result<(), TrainError> {
    optimiser_file::save(&dir.join(files::OPTIMISER), avatar, optimiser)?;
    save_model(dir, state, avatar)
}

/// Writes weights and state into `dir`. Equal models give equal bytes.
pub(crate) fn save_model(
    dir: &Path,
    state: &ModelState,
    avatar: &Avatar,
) -> Result<(), TrainError> {
    let weights = dir.join(files::WEIGHTS);
    // Burn's own three entries come in an order that changes from run to run.
    let mut store = SafetensorsStore::from_file(&weights)
        .overwrite(true)
        .clear_metadata()
        .metadata("format", "safetensors")
        .remap(stored_names::to_checkpoint());
    if !state.erased.is_empty() {
        let gone = |slot: usize| state.erased.contains(&slot);
        let names = own::paths(avatar).into_iter();
        let kept = names.filter(|name| !own::owner(&stored(name)).is_some_and(gone));
        store = store.with_full_paths(kept);
    }
    avatar
        .save_into(&mut store)
        .map_err(|e| failed(&weights, e))?;
    let path = dir.join(files::STATE);
    save_state(dir, state)?;
    // Burn creates the file as a temporary one, which only its owner may read.
    let permissions = std::fs::metadata(&path).map_err(|e| failed(&path, e))?;
    std::fs::set_permissions(&weights, permissions.permissions()).map_err(|e| failed(&weights, e))
}

/// Writes `state.json` into `dir`.
pub(crate) fn save_state(dir: &Path, state: &ModelState) -> Result<(), TrainError> {
    let path = dir.join(files::STATE);
    let json = serde_json::to_vec_pretty(state).map_err(|e| failed(&path, e))?;
    std::fs::write(&path, json).map_err(|e| failed(&path, e))
}

/// The model of a state with the weights in `dir`. If it has fewer than `slots` identities, new
/// ones are added.
pub(crate) fn load_avatar(
    dir: &Path,
    state: &ModelState,
    slots: usize,
    device: &Device,
) -> Result<Avatar, TrainError> {
    let path = dir.join(files::WEIGHTS);
    let grown = slots.max(state.slots.len());
    let mut avatar = Avatar::new(&state.config, grown, state.joints, state.seed, device);
    expect_optional(&mut avatar, &path)?;
    let mut store = SafetensorsStore::from_file(&path)
        .allow_partial(true)
        .remap(stored_names::from_checkpoint());
    let found = avatar.load_from(&mut store).map_err(|e| failed(&path, e))?;
    // The file lacks what is of somebody who is new, or who was removed.
    let absent = |slot: usize| slot >= state.slots.len() || state.erased.contains(&slot);
    let lacks = |name: &String| !own::owner(name).is_some_and(absent);
    let mut missing = found.missing.iter().map(|(name, _)| stored(name));
    if let Some(name) = missing.find(lacks) {
        return Err(failed(&path, format!("missing tensor: {name}")));
    }
    for (slot, splats) in avatar.splats.iter().enumerate() {
        let good = splats.has_good_bones(state.joints_of(slot).unwrap_or(state.joints));
        if !good.map_err(|e| failed(&path, e))? {
            let [bones, weights] = skinning_paths(slot);
            return Err(failed(
                &path,
                format!("{bones}, {weights}: not bones of the skeleton with weights that sum to 1"),
            ));
        }
    }
    Ok(avatar)
}

/// Makes room in `avatar` for what only some checkpoints have: flags of frozen colours late in a run and in finished models, and the bones
/// of splats that lie on a body's surface.
fn expect_optional(avatar: &mut Avatar, weights: &Path) -> Result<(), TrainError> {
    let bytes = std::fs::read(weights).map_err(|e| failed(weights, e))?;
    let file = SafeTensors::deserialize(&bytes).map_err(|e| failed(weights, e))?;
    for slot in 0..avatar.splats.len() {
        if let Ok(flags) = file.tensor(&frozen_path(slot)) {
            let count = flags.shape().iter().product();
            avatar
                .freeze_colours(slot, Some(&vec![false; count]))
                .map_err(|e| failed(weights, e))?;
        }
        let paths = skinning_paths(slot);
        match paths.each_ref().map(|path| file.tensor(path)) {
            [Ok(_), Ok(_)] => avatar.expect_surface(slot),
            [Err(_), Err(_)] => {}
            _ => {
                let [bones, base] = paths;
                return Err(failed(
                    weights,
                    format!("{bones} without {base}, or the reverse"),
                ));
            }
        }
    }
    Ok(())
}

/// The optimiser in `dir`, in place of the `fresh` one.
pub(crate) fn load_optimiser(
    dir: &Path,
    fresh: ModuleOptimizer,
) -> Result<ModuleOptimizer, TrainError> {
    optimiser_file::load(&dir.join(files::OPTIMISER), fresh)
}

impl Renderer {
    /// Reads the model of a checkpoint's folder.
    ///
    /// # Errors
    /// If weights or state are missing, or they do not belong together.
    pub fn load(dir: &Path, device: &Device) -> Result<Self, TrainError> {
        let state = ModelState::read(dir)?;
        let device = state.config.render_device(&device.clone().inner())?;
        let avatar = load_avatar(dir, &state, 0, &device)?;
        let body = |skeleton: &Option<Skeleton>| {
            skeleton
                .clone()
                .map(|skeleton| CanonicalBody::new(skeleton, &state.config, &device))
        };
        let bodies = state.slots.iter().map(body).collect();
        let occupancy = load_occupancy(dir, &state)?;
        Ok(Self::new(
            state.config,
            avatar,
            bodies,
            occupancy,
            state.schedule_progress,
        )
        .without(state.erased))
    }
}
