//! Files of weights. Tensors are read by name and their shapes are checked, so that a wrong file
//! gives an error instead of wrong figures.

use super::LpipsError;
use burn::store::{ModuleStore, PytorchStore, SafetensorsStore, bridge};
use burn::tensor::{Device, Tensor, TensorData};
use std::fmt::Display;
use std::path::{Path, PathBuf};

/// An open file of weights, whose tensors are read on demand.
pub(super) struct WeightsFile {
    path: PathBuf,
    store: Store,
}

enum Store {
    Safetensors(Box<SafetensorsStore>),
    Pytorch(Box<PytorchStore>),
}

impl WeightsFile {
    /// Reads the list of tensors. A file with the extension `.safetensors` is read as such, all
    /// others as PyTorch's.
    pub(super) fn open(path: &Path) -> Result<Self, LpipsError> {
        let unreadable = |message: String| LpipsError::File {
            file: path.to_path_buf(),
            message,
        };
        // Opened first, so that a missing file gives the error of the system.
        std::fs::File::open(path).map_err(|e| unreadable(e.to_string()))?;
        let store = if path.extension().is_some_and(|e| e == "safetensors") {
            let mut store = SafetensorsStore::from_file(path);
            store.keys().map_err(|e| unreadable(e.to_string()))?;
            Store::Safetensors(Box::new(store))
        } else {
            // Indices such as in `features.7.weight` must not be renumbered.
            let mut store = PytorchStore::from_file(path).map_indices_contiguous(false);
            store.keys().map_err(|e| unreadable(e.to_string()))?;
            Store::Pytorch(Box::new(store))
        };
        Ok(Self {
            path: path.to_path_buf(),
            store,
        })
    }

    /// The tensor called `name`, in single precision.
    ///
    /// # Errors
    /// If it is missing, has another shape, or holds a value that is not finite.
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
            return Err(unusable(&"not all values are finite"));
        }
        Ok(Tensor::from_data(TensorData::new(values, shape), device))
    }
}
