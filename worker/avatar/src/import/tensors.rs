//! The tensors of a checkpoint that `torch.save` wrote, by name. Nothing in the file is run.

use super::ImportError;
use burn::store::pytorch_reader::{DType, PytorchError, PytorchReader, Tensor};
use burn::tensor::{bf16, f16};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

/// Key of the networks in a training's checkpoint; a bare state dict has none.
const NETWORK: &str = "network";
/// The prefix of names by wrappers for several devices.
const WRAPPER: &str = "module";
/// The prefix of the names of HumanNeRF's tensors.
const PARTS: [&str; 4] = [
    "mweight_vol_decoder",
    "non_rigid_mlp",
    "cnl_mlp",
    "pose_decoder",
];

/// Names without wrappers, and the tensors behind them.
pub(super) struct Tensors {
    by_name: BTreeMap<String, Tensor>,
    /// Training iteration, where the file has one.
    pub iteration: Option<u64>,
    faults: Vec<String>,
}

/// The part of a checkpoint outside its tensors.
#[derive(Deserialize)]
struct Meta {
    iter: Option<u64>,
}

impl Tensors {
    /// Reads names and shapes; values come when asked for.
    ///
    /// # Errors
    /// When the file is not one that PyTorch wrote, or holds none of HumanNeRF's tensors.
    pub(super) fn open(path: &Path) -> Result<Self, ImportError> {
        let reader = match PytorchReader::with_top_level_key(path, NETWORK) {
            // A bare state dict, or no dict at all.
            Err(PytorchError::KeyNotFound(_) | PytorchError::InvalidFormat(_)) => {
                PytorchReader::new(path)
            }
            reader => reader,
        }
        .map_err(|error| {
            ImportError::file(path, format!("not a checkpoint of PyTorch: {error}"))
        })?;
        let plain = |name: String| {
            let parts: Vec<&str> = name.split('.').filter(|part| *part != WRAPPER).collect();
            parts.join(".")
        };
        let by_name: BTreeMap<String, Tensor> = reader
            .into_tensors()
            .into_iter()
            .map(|(name, tensor)| (plain(name), tensor))
            .collect();
        let known = |name: &String| PARTS.iter().any(|part| name.starts_with(part));
        if !by_name.keys().any(known) {
            let message = match by_name.keys().next() {
                None => "it has no tensors".to_owned(),
                Some(name) => format!(
                    "none of its {} tensors is one of HumanNeRF's, the first is '{name}'",
                    by_name.len()
                ),
            };
            return Err(ImportError::NoNetwork {
                file: path.display().to_string(),
                message,
            });
        }
        Ok(Self {
            by_name,
            iteration: PytorchReader::load_config::<Meta, _>(path, None)
                .ok()
                .and_then(|meta| meta.iter),
            faults: Vec::new(),
        })
    }

    /// Extents of a tensor; empty when it is missing.
    pub(super) fn shape(&self, name: &str) -> &[usize] {
        self.by_name.get(name).map_or(&[], Tensor::shape)
    }

    /// The tensor's numbers, which must be floats in `shape`. [`Self::finish`] reports the faults
    /// of all tensors at once.
    pub(super) fn take(&mut self, name: &str, shape: &[usize]) -> Vec<f32> {
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
        let bytes = tensor.read().map_err(|error| format!("{name}: {error}"))?;
        let values: Vec<f32> = match tensor.dtype() {
            DType::F64 => each(&bytes, |b| f64::from_ne_bytes(b) as f32),
            DType::F32 => each(&bytes, f32::from_ne_bytes),
            DType::F16 => each(&bytes, |b| f16::from_ne_bytes(b).to_f32()),
            DType::BF16 => each(&bytes, |b| bf16::from_ne_bytes(b).to_f32()),
            other => return Err(format!("{name} has numbers of type {other:?}, not floats")),
        };
        match values.iter().position(|v| !v.is_finite()) {
            Some(at) => Err(format!("{name}[{at}] is not a finite number")),
            None => Ok(values),
        }
    }

    /// # Errors
    /// All faults of [`Self::take`].
    pub(super) fn finish(self, path: &Path) -> Result<(), ImportError> {
        if self.faults.is_empty() {
            return Ok(());
        }
        Err(ImportError::Tensors {
            file: path.display().to_string(),
            faults: self.faults,
        })
    }
}

/// The numbers of `N` bytes each in `bytes`.
fn each<const N: usize>(bytes: &[u8], number: impl Fn([u8; N]) -> f32) -> Vec<f32> {
    let (numbers, _) = bytes.as_chunks::<N>();
    numbers.iter().map(|b| number(*b)).collect()
}
