//! The optimiser's file of a checkpoint. It has the moments of each parameter by the parameter's number, and the
//! parameter's path, by which Burn finds its learning rate again. Paths have the names of checkpoints
//! ([`stored_names`](crate::identity::stored_names)).

use crate::avatar::Avatar;
use crate::identity::own;
use crate::identity::stored_names::{field, stored};
use crate::train::TrainError;
use burn::optim::ModuleOptimizer;
use burn::tensor::Bytes;
use burn_pack::{Error, Reader, Writer};
use std::path::Path;

fn failed(path: &Path, error: impl std::fmt::Display) -> TrainError {
    TrainError::File {
        file: path.display().to_string(),
        message: error.to_string(),
    }
}

/// Writes the `optimiser` of `avatar` to `path`.
pub(super) fn save(
    path: &Path,
    avatar: &Avatar,
    optimiser: &ModuleOptimizer,
) -> Result<(), TrainError> {
    // Burn does not overwrite files.
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            return Err(failed(path, error));
        }
        _ => {}
    }
    // Most models have no renamed parameters, and moments are twice as large as a model.
    if own::paths(avatar).iter().all(|it| stored(it) == *it) {
        return optimiser.save(path).map_err(|e| failed(path, e));
    }
    let bytes = optimiser.into_bytes().map_err(|e| failed(path, e))?;
    let renamed = with_paths(bytes, stored).map_err(|e| failed(path, e))?;
    renamed.write_to_file(path).map_err(|e| failed(path, e))
}

/// The optimiser in the file at `path`, in place of the `fresh` one. The whole file is read: Burn's `load` reads a
/// tensor at its first use, when the caller's folder may no longer exist.
pub(super) fn load(path: &Path, fresh: ModuleOptimizer) -> Result<ModuleOptimizer, TrainError> {
    let bytes = std::fs::read(path).map_err(|e| failed(path, e))?;
    let mut bytes = Bytes::from_bytes_vec(bytes);
    // Burn says below what is wrong with a damaged file.
    let renamed = Reader::from_file(path)
        .is_ok_and(|head| head.metadata().values().any(|it| field(it) != *it));
    if renamed {
        let with_fields = with_paths(bytes, field).and_then(Writer::into_bytes);
        bytes = with_fields.map_err(|e| failed(path, e))?;
    }
    fresh.from_bytes(bytes).map_err(|e| failed(path, e))
}

/// A file with the content of `bytes`, whose paths are renamed.
fn with_paths(bytes: Bytes, rename: impl Fn(&str) -> String) -> Result<Writer, Error> {
    let reader = Reader::from_bytes(bytes)?;
    let (scalars, paths) = (reader.scalars().clone(), reader.metadata().clone());
    let mut writer = Writer::new(reader.into_tensors()?);
    for (name, value) in &scalars {
        writer = writer.with_scalar(name, *value);
    }
    for (id, path) in &paths {
        writer = writer.with_metadata(id, &rename(path));
    }
    Ok(writer)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::ModelConfig;
    use crate::host::read;
    use crate::train::run::optimiser::optimiser;
    use burn::optim::GradientsParams;
    use burn::tensor::Device;
    use yoto_proto::manifest::files;

    /// A step of the rotations by a gradient of 1.
    fn step(optimiser: &mut ModuleOptimizer, avatar: Avatar) -> Avatar {
        let loss = avatar.splats[0].rotations.val().sum();
        let grads = GradientsParams::from_grads(loss.backward(), &avatar);
        optimiser.step(1.0, avatar, grads)
    }

    #[test]
    fn moments_have_stored_paths_and_find_their_rates_again() {
        let mut config = ModelConfig::named("splat", "yoto").expect("a tier");
        let splats = config.appearance.splats_mut().expect("splats");
        (splats.count, splats.rotation_rate) = (64, 0.25);
        let avatar = Avatar::new(&config, 1, 4, 3, &Device::flex().autodiff());
        let mut first = optimiser(&config);
        let avatar = step(&mut first, avatar);
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join(files::OPTIMISER);
        for _ in 0..2 {
            save(&path, &avatar, &first).expect("saves, and again");
        }
        let reader = Reader::from_file(&path).expect("a file");
        let paths: Vec<&String> = reader.metadata().values().collect();
        assert_eq!(paths, ["splats.0.turns"]);
        let mut loaded = load(&path, optimiser(&config)).expect("loads");
        let rotations = |avatar: Avatar| read(avatar.splats[0].rotations.val()).expect("reads");
        let went_on = rotations(step(&mut first, avatar.clone()));
        assert_eq!(rotations(step(&mut loaded, avatar.clone())), went_on);
        let moved = rotations(avatar)[1] - went_on[1];
        assert!((moved - 0.25).abs() < 1e-3, "at its own rate: {moved}");
    }
}
