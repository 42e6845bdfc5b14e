//! The tensors of a checkpoint that `torch.save` wrote, by name. Nothing in the file is run.

use super::ImportError;
use burn::store::pytorch_reader::{DType, PytorchError, PytorchReader, Tensor};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

/// Key of the networks in a training's checkpoint; a bare state dict has none.
const NETWORK: &str = "network";
/// What wrappers for several devices put into names.
const WRAPPER: &str = "module";

/// Names without wrappers, and the tensors behind them.
pub(super) struct Tensors {
    by_name: BTreeMap<String, Tensor>,
    /// Training iteration, where the file has one.
    pub iteration: Option<u64>,
    faults: Vec<String>,
}

/// The part of a checkpoint that is no tensor.
#[derive(Deserialize)]
struct Meta {
    iter: Option<u64>,
}

impl Tensors {
    /// Reads names and shapes; values come when asked for.
    pub fn open(path: &Path) -> Result<Self, ImportError> {
        let reader = match PytorchReader::with_top_level_key(path, NETWORK) {
            Err(PytorchError::KeyNotFound(_)) => PytorchReader::new(path),
            reader => reader,
        }
        .map_err(|error| {
            ImportError::file(path, format!("not a checkpoint of PyTorch: {error}"))
        })?;
        let plain = |name: String| {
            let parts: Vec<&str> = name.split('.').filter(|part| *part != WRAPPER).collect();
            parts.join(".")
        };
        Ok(Self {
            by_name: reader
                .into_tensors()
                .into_iter()
                .map(|(name, tensor)| (plain(name), tensor))
                .collect(),
            iteration: PytorchReader::load_config::<Meta, _>(path, None)
                .ok()
                .and_then(|meta| meta.iter),
            faults: Vec::new(),
        })
    }

    /// Extents of a tensor; empty when it is missing.
    pub fn shape(&self, name: &str) -> &[usize] {
        self.by_name.get(name).map_or(&[], Tensor::shape)
    }

    /// The tensor's numbers, which must be floats in `shape`. A fault is kept for
    /// [`Self::finish`], so that all of them can be told at once.
    pub fn take(&mut self, name: &str, shape: &[usize]) -> Vec<f32> {
        match self.read(name, shape) {
            Ok(values) => values,
            Err(fault) => {
                self.faults.push(fault);
                Vec::new()
            }
        }
    }

    fn read(&self, name: &str, shape: &[usize]) -> Result<Vec<f32>, String> {
        let tensor = self
            .by_name
            .get(name)
            .ok_or_else(|| format!("{name} is missing"))?;
        if tensor.shape() != shape {
            return Err(format!(
                "{name} is {:?}, {shape:?} is needed",
                tensor.shape()
            ));
        }
        let bytes = match tensor.dtype() {
            DType::F32 | DType::F64 => tensor.read().map_err(|error| format!("{name}: {error}"))?,
            other => return Err(format!("{name} has numbers of type {other:?}, not floats")),
        };
        let values: Vec<f32> = match tensor.dtype() {
            DType::F64 => {
                let (numbers, _) = bytes.as_chunks::<8>();
                numbers
                    .iter()
                    .map(|b| f64::from_ne_bytes(*b) as f32)
                    .collect()
            }
            _ => {
                let (numbers, _) = bytes.as_chunks::<4>();
                numbers.iter().map(|b| f32::from_ne_bytes(*b)).collect()
            }
        };
        match values.iter().position(|v| !v.is_finite()) {
            Some(at) => Err(format!("{name}[{at}] is not a finite number")),
            None => Ok(values),
        }
    }

    /// # Errors
    /// All that [`Self::take`] met.
    pub fn finish(self, path: &Path) -> Result<(), ImportError> {
        if self.faults.is_empty() {
            return Ok(());
        }
        Err(ImportError::Tensors {
            file: path.display().to_string(),
            faults: self.faults,
        })
    }
}
