//! A training that starts with the trunk of another model: what all of its people share.

use crate::identity::own;
use crate::train::run::checkpoint::ModelState;
use crate::train::{TrainError, Trainer};
use burn::store::{ModuleSnapshot, SafetensorsStore};
use safetensors::SafeTensors;
use std::path::Path;
use yoto_proto::manifest::files;

impl Trainer {
    /// Takes the shared networks, tables and motion weights of the model in the folder `dir` as the start of
    /// this training; what belongs to its people stays there.
    ///
    /// # Errors
    /// If a step was taken, or the models have not the same parts.
    pub fn with_trunk_of(mut self, dir: &Path) -> Result<Self, TrainError> {
        let path = dir.join(files::WEIGHTS);
        let failed = |message: String| TrainError::File {
            file: path.display().to_string(),
            message,
        };
        if self.run.moment().step > 0 {
            return Err(failed(
                "a training that has begun has a trunk already".into(),
            ));
        }
        let other = ModelState::read(dir)?;
        if other.joints != self.model.joints {
            return Err(failed(format!(
                "its skeletons have {} joints, those of this training have {}",
                other.joints, self.model.joints
            )));
        }
        let bytes = std::fs::read(&path).map_err(|e| failed(e.to_string()))?;
        let tensors = SafeTensors::deserialize(&bytes).map_err(|e| failed(e.to_string()))?;
        let names = tensors.names().into_iter();
        let trunk: Vec<&str> = names.filter(|name| own::owner(name).is_none()).collect();
        let mut store = SafetensorsStore::from_file(&path)
            .with_full_paths(trunk.iter().copied())
            .allow_partial(true);
        let unlike = || {
            failed(format!(
                "a model of the tier {} has not the same trunk as this one of the tier {}",
                other.config.tier, self.model.config.tier
            ))
        };
        // Of a tensor with another shape the store says no more than that.
        let applied = self.model.state.avatar_mut().load_from(&mut store);
        let applied = applied.map_err(|_| unlike())?;
        let missing = applied.missing.iter().map(|(name, _)| name);
        // The other model may have more people.
        let mut odd = missing.chain(&applied.unused);
        match odd.any(|name| own::owner(name).is_none()) || applied.applied.is_empty() {
            true => Err(unlike()),
            false => Ok(self),
        }
    }
}
