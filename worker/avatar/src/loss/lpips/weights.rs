//! Weights from somebody else's file: each tensor by name, checked by shape before it is used,
//! so that the wrong file is refused with words and not with strange numbers.

use super::LpipsError;
use burn::store::{ModuleStore, PytorchStore, SafetensorsStore, bridge};
use burn::tensor::{Device, Tensor, TensorData};
use std::fmt::Display;
use std::path::{Path, PathBuf};

/// An open file; tensors are read when asked for.
pub(super) struct WeightsFile {
    path: PathBuf,
    store: Store,
}

enum Store {
    Safetensors(Box<SafetensorsStore>),
    Pytorch(Box<PytorchStore>),
}

impl WeightsFile {
    /// Reads the file's list of tensors: safetensors if the name says so, else PyTorch's.
    pub(super) fn open(path: &Path) -> Result<Self, LpipsError> {
        let unreadable = |message: String| LpipsError::File {
            file: path.to_path_buf(),
            message,
        };
        // Asked first, so that a missing file is told in the system's own words.
        std::fs::File::open(path).map_err(|e| unreadable(e.to_string()))?;
        let store = if path.extension().is_some_and(|e| e == "safetensors") {
            let mut store = SafetensorsStore::from_file(path);
            store.keys().map_err(|e| unreadable(e.to_string()))?;
            Store::Safetensors(Box::new(store))
        } else {
            // The numbers in `features.7.weight` are to stay as they are.
            let mut store = PytorchStore::from_file(path).map_indices_contiguous(false);
            store.keys().map_err(|e| unreadable(e.to_string()))?;
            Store::Pytorch(Box::new(store))
        };
        Ok(Self {
            path: path.to_path_buf(),
            store,
        })
    }

    /// The tensor of that name, in single precision.
    ///
    /// # Errors
    /// When it is missing, of another shape, or holds a number that is not finite.
    pub(super) fn tensor<const D: usize>(
        &mut self,
        name: &str,
        shape: [usize; D],
        device: &Device,
    ) -> Result<Tensor<D>, LpipsError> {
        let path = self.path.clone();
        let unusable = |message: &dyn Display| LpipsError::Values {
            file: path.clone(),
            tensor: name.to_owned(),
            message: message.to_string(),
        };
        let found = match &mut self.store {
            Store::Safetensors(store) => store.get_tensor(name).map_err(|e| unusable(&e))?,
            Store::Pytorch(store) => store.get_tensor(name).map_err(|e| unusable(&e))?,
        };
        let Some(found) = found else {
            return Err(LpipsError::Missing {
                file: path,
                tensor: name.to_owned(),
                expected: shape.to_vec(),
            });
        };
        if found.shape.as_slice() != shape {
            return Err(LpipsError::Shape {
                file: path,
                tensor: name.to_owned(),
                expected: shape.to_vec(),
                found: found.shape.to_vec(),
            });
        }
        let values: Vec<f32> = bridge::to_data(found)
            .map_err(|e| unusable(&e))?
            .try_into_vec_as()
            .map_err(|e| unusable(&format!("{e:?}")))?;
        if !values.iter().all(|v| v.is_finite()) {
            return Err(unusable(&"holds numbers that are not finite"));
        }
        Ok(Tensor::from_data(TensorData::new(values, shape), device))
    }
}
