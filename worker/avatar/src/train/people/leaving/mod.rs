//! Somebody leaves a model: a checkpoint is written anew without what is theirs.
//!
//! Their own parameters go, with the moments of the optimiser, occupancy, refined poses, exposures, skeleton
//! and pictures. What the shared weights have learned from them can't be taken out of them: the [`Certificate`] says
//! whether there is anything.

mod certificate;
mod own_part;
mod residue;
mod rewrite;

pub use certificate::{Certificate, Removed, SharedWeights};
pub use own_part::own_part;
pub use residue::{Finding, Residue};

use crate::train::frames::order::PersonSteps;
use crate::train::poses::refinement_file;
use crate::train::run::checkpoint::{ModelState, save_state};
use crate::train::{TrainError, exposure};
use std::path::Path;
use yoto_proto::manifest::files;
use yoto_proto::sha256_hex;

/// Writes the checkpoint in the folder `from` into the folder `to`, which must not exist, without the person
/// in `slot`, and searches what was written for what was theirs. Everybody else's part is the same bit for bit.
///
/// # Errors
/// If nobody is in the slot, files can't be read or written, or the search finds anything: then `to` is
/// removed again.
pub fn remove_person(from: &Path, to: &Path, slot: usize) -> Result<Certificate, TrainError> {
    let failed = |path: &Path, error: &dyn std::fmt::Display| TrainError::File {
        file: path.display().to_string(),
        message: error.to_string(),
    };
    let mut state = ModelState::read(from)?;
    if state.erased.contains(&slot) {
        return Err(failed(
            from,
            &format!("the person in slot {slot} was removed already"),
        ));
    }
    if state.slots.get(slot).is_none_or(Option::is_none) {
        let known = state.slots.iter().enumerate();
        let known = known.filter_map(|(slot, it)| it.as_ref().map(|_| slot.to_string()));
        let known: Vec<String> = known.collect();
        return Err(failed(
            from,
            &format!(
                "it knows nobody in slot {slot}, only in {}",
                known.join(", ")
            ),
        ));
    }
    let shared_weights = match state.own_only.contains(&slot) {
        true => SharedWeights::NeverSawThem,
        false => SharedWeights::SawThem,
    };
    let residue = Residue::of(from, &state, slot)?;
    if to.exists() {
        return Err(failed(to, &"it exists; choose a new folder"));
    }
    // Nobody sees the folder before it is whole.
    let parent = to.parent().filter(|it| !it.as_os_str().is_empty());
    let parent = parent.unwrap_or_else(|| Path::new("."));
    std::fs::create_dir_all(parent).map_err(|e| failed(parent, &e))?;
    let name = to.file_name().unwrap_or_default().to_string_lossy();
    let half = parent.join(format!(".{name}.{}", std::process::id()));
    let written = written(from, &half, &mut state, slot, &residue);
    let found = written.and_then(|removed| {
        std::fs::rename(&half, to).map_err(|e| failed(to, &e))?;
        Ok(removed)
    });
    let removed = found.inspect_err(|_| {
        // The first error is the one to tell.
        let _ = std::fs::remove_dir_all(&half);
    })?;
    let weights = to.join(files::WEIGHTS);
    let bytes = std::fs::read(&weights).map_err(|e| failed(&weights, &e))?;
    Ok(Certificate {
        version: certificate::VERSION,
        slot,
        step: state.step,
        shared_weights,
        removed,
        searched: residue.len(),
        weights: sha256_hex(&bytes),
    })
}

/// Writes all files into the new folder `to`, and searches them.
fn written(
    from: &Path,
    to: &Path,
    state: &mut ModelState,
    slot: usize,
    residue: &Residue,
) -> Result<Removed, TrainError> {
    std::fs::create_dir(to).map_err(|e| TrainError::File {
        file: to.display().to_string(),
        message: e.to_string(),
    })?;
    let mut removed = Removed {
        tensors: rewrite::weights(from, to, slot)?,
        moments: rewrite::optimiser(from, to, slot)?,
        occupancy: rewrite::occupancy(from, to, slot)?,
        files: rewrite::left_out(from, slot)?,
        ..Removed::default()
    };
    let mut poses = refinement_file::load(from, |slot| state.joints_of(slot))?;
    removed.refinement = poses.get_mut(slot).and_then(Option::take).is_some();
    refinement_file::save(to, &poses)?;
    let mut films = exposure::file::load(from)?;
    removed.exposures = films.get_mut(slot).and_then(Option::take).is_some();
    exposure::file::save(to, &films)?;
    for (other, file) in refinement_file::others(from, &[])? {
        if other != slot {
            refinement_file::keep(to, other, &file)?;
        }
    }
    state.slots[slot] = None;
    state.own_only.remove(&slot);
    state.priors.remove(&slot);
    if let Some(steps) = state.steps_per_person.get_mut(slot) {
        *steps = PersonSteps::default();
    }
    state.erased.insert(slot);
    save_state(to, state)?;
    match residue.search(to)?.into_iter().next() {
        None => Ok(removed),
        Some(finding) => Err(TrainError::File {
            file: to.join(&finding.file).display().to_string(),
            message: format!("{} is still in it: nothing was removed", finding.what),
        }),
    }
}
