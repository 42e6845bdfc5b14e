//! The files of a checkpoint without one person. Tensors of the others are copied as they are.

use crate::identity::own::owner;
use crate::init;
use crate::train::TrainError;
use burn::tensor::Bytes;
use burn_pack::{Reader, Tensor, Writer};
use safetensors::SafeTensors;
use std::collections::{BTreeSet, HashMap};
use std::path::Path;
use yoto_proto::manifest::files;

pub(super) fn failed(path: &Path, error: impl std::fmt::Display) -> TrainError {
    TrainError::File {
        file: path.display().to_string(),
        message: error.to_string(),
    }
}

/// The bytes of a file that not every checkpoint has.
pub(super) fn read(path: &Path) -> Result<Option<Vec<u8>>, TrainError> {
    match std::fs::read(path) {
        Ok(bytes) => Ok(Some(bytes)),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(failed(path, error)),
    }
}

/// Whether a tensor of the occupancy file is of the person in `slot`.
pub(super) fn is_occupancy_of(name: &str, slot: usize) -> bool {
    let (whose, _) = name.split_once('.').unwrap_or((name, ""));
    whose.parse() == Ok(slot)
}

/// Ids of the parameters with these names, as the optimiser's file has them.
pub(super) fn ids<'a>(names: impl IntoIterator<Item = &'a str>) -> BTreeSet<u64> {
    names.into_iter().map(|name| init::id(name).val()).collect()
}

/// Names of the tensors in `from` that are the person's own.
pub(super) fn own_tensors(from: &Path, slot: usize) -> Result<Vec<String>, TrainError> {
    let path = from.join(files::WEIGHTS);
    let bytes = std::fs::read(&path).map_err(|e| failed(&path, e))?;
    let tensors = SafeTensors::deserialize(&bytes).map_err(|e| failed(&path, e))?;
    let own = tensors
        .names()
        .into_iter()
        .filter(|name| owner(name) == Some(slot));
    let mut own: Vec<String> = own.map(str::to_owned).collect();
    own.sort_unstable();
    Ok(own)
}

/// Writes the weights without those of the person in `slot`; the names of theirs.
pub(super) fn weights(from: &Path, to: &Path, slot: usize) -> Result<Vec<String>, TrainError> {
    tensors(from, to, files::WEIGHTS, |name| owner(name) == Some(slot))
}

/// Writes the occupancy grids without that of the person in `slot`; whether there was one.
pub(super) fn occupancy(from: &Path, to: &Path, slot: usize) -> Result<bool, TrainError> {
    if !from.join(files::OCCUPANCY).exists() {
        return Ok(false);
    }
    let gone = tensors(from, to, files::OCCUPANCY, |name| {
        is_occupancy_of(name, slot)
    })?;
    Ok(!gone.is_empty())
}

/// Writes the tensors of a `file` without those that are `gone`, whose names it returns.
fn tensors(
    from: &Path,
    to: &Path,
    file: &str,
    gone: impl Fn(&str) -> bool,
) -> Result<Vec<String>, TrainError> {
    let (old, new) = (from.join(file), to.join(file));
    let bytes = std::fs::read(&old).map_err(|e| failed(&old, e))?;
    let (_, header) = SafeTensors::read_metadata(&bytes).map_err(|e| failed(&old, e))?;
    let said: Option<HashMap<String, String>> = header.metadata().clone();
    let all = SafeTensors::deserialize(&bytes).map_err(|e| failed(&old, e))?;
    let (theirs, others): (Vec<_>, Vec<_>) = all.tensors().into_iter().partition(|it| gone(&it.0));
    let written = safetensors::serialize(others, said).map_err(|e| failed(&new, e))?;
    std::fs::write(&new, written).map_err(|e| failed(&new, e))?;
    let mut names: Vec<String> = theirs.into_iter().map(|(name, _)| name).collect();
    names.sort_unstable();
    Ok(names)
}

/// Writes the optimiser's state without that of the person in `slot`; the number of its tensors. A folder
/// for rendering has none.
pub(super) fn optimiser(from: &Path, to: &Path, slot: usize) -> Result<usize, TrainError> {
    let (old, new) = (from.join(files::OPTIMISER), to.join(files::OPTIMISER));
    let Some(bytes) = read(&old)? else {
        return Ok(0);
    };
    let theirs = own_tensors(from, slot)?;
    let theirs = ids(theirs.iter().map(String::as_str));
    // Entries are called by the parameter's id, alone or followed by a dot.
    let is_theirs = |name: &str| {
        let (id, _) = name.split_once('.').unwrap_or((name, ""));
        id.parse().is_ok_and(|id| theirs.contains(&id))
    };
    let reader = Reader::from_bytes(Bytes::from_bytes_vec(bytes)).map_err(|e| failed(&old, e))?;
    let (scalars, said) = (reader.scalars().clone(), reader.metadata().clone());
    let mut kept = Vec::new();
    let mut gone = 0;
    for tensor in reader.into_tensors().map_err(|e| failed(&old, e))? {
        let (name, dtype, shape, id, bytes) = tensor.into_parts().map_err(|e| failed(&old, e))?;
        match is_theirs(&name) {
            true => gone += 1,
            false => kept.push(Tensor::new(name, dtype, shape, id, bytes)),
        }
    }
    let mut writer = Writer::new(kept);
    for (name, value) in scalars.iter().filter(|(name, _)| !is_theirs(name)) {
        writer = writer.with_scalar(name, *value);
    }
    for (name, value) in said.iter().filter(|(name, _)| !is_theirs(name)) {
        writer = writer.with_metadata(name, value);
    }
    writer.write_to_file(&new).map_err(|e| failed(&new, e))?;
    Ok(gone)
}

/// Names of the files in `from` that are left out: the person's refined poses, pictures of everybody, and
/// any file that does not belong to a checkpoint, since its contents are unknown.
pub(super) fn left_out(from: &Path, slot: usize) -> Result<Vec<String>, TrainError> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(from).map_err(|e| failed(from, e))? {
        let entry = entry.map_err(|e| failed(from, e))?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let kept = match files::refined_by(&name) {
            Some(other) => other != slot,
            None => [
                files::WEIGHTS,
                files::OPTIMISER,
                files::OCCUPANCY,
                files::REFINEMENT,
                files::EXPOSURES,
                files::STATE,
            ]
            .contains(&&*name),
        };
        if !kept {
            found.push(name);
        }
    }
    found.sort_unstable();
    Ok(found)
}
