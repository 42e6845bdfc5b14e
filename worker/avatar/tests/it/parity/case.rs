//! Files of cases: inputs, expected values, and gradients, written by the reference.

use burn::tensor::{Device, Tensor, TensorData};
use safetensors::{Dtype, SafeTensors};
use std::collections::BTreeMap;
use std::path::PathBuf;
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::Skeleton;

/// Path of a file of the cases' folder.
pub(crate) fn path(name: &str) -> PathBuf {
    PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").expect("cargo runs the tests"))
        .join("tests/cases")
        .join(format!("{name}.safetensors"))
}

/// Values and their shape.
struct Numbers {
    shape: Vec<usize>,
    values: Vec<f64>,
}

/// A case.
pub(crate) struct Case {
    pub name: &'static str,
    tensors: BTreeMap<String, Numbers>,
    joint_names: Vec<String>,
}

impl Case {
    /// Reads the case `name`.
    pub(crate) fn read(name: &'static str) -> Self {
        let bytes = std::fs::read(path(name)).expect("a case");
        let file = SafeTensors::deserialize(&bytes).expect("safetensors");
        let tensors = file
            .iter()
            .map(|(name, view)| {
                let values = match view.dtype() {
                    Dtype::F64 => chunks(view.data(), f64::from_le_bytes),
                    Dtype::F32 => chunks(view.data(), |b| f64::from(f32::from_le_bytes(b))),
                    Dtype::I64 => chunks(view.data(), |b| i64::from_le_bytes(b) as f64),
                    other => panic!("{name}: {other:?}"),
                };
                let shape = view.shape().to_vec();
                (name.to_owned(), Numbers { shape, values })
            })
            .collect();
        let (_, header) = SafeTensors::read_metadata(&bytes).expect("a header");
        let joint_names = header
            .metadata()
            .as_ref()
            .and_then(|m| m.get("names"))
            .map(|names| names.split(',').map(String::from).collect())
            .unwrap_or_default();
        Self {
            name,
            tensors,
            joint_names,
        }
    }

    fn entry(&self, name: &str) -> &Numbers {
        self.tensors
            .get(name)
            .unwrap_or_else(|| panic!("{}: no '{name}'", self.name))
    }

    /// The values called `name`.
    pub(crate) fn numbers(&self, name: &str) -> &[f64] {
        &self.entry(name).values
    }

    /// The shape of `name`.
    pub(crate) fn shape(&self, name: &str) -> &[usize] {
        &self.entry(name).shape
    }

    /// The values called `name`, in single precision.
    pub(crate) fn singles(&self, name: &str) -> Vec<f32> {
        self.numbers(name).iter().map(|v| *v as f32).collect()
    }

    /// The values called `name`, which are three.
    pub(crate) fn vector(&self, name: &str) -> [f32; 3] {
        self.singles(name).try_into().expect("3 numbers")
    }

    /// The values called `name`, as a tensor.
    pub(crate) fn tensor<const D: usize>(&self, name: &str, device: &Device) -> Tensor<D> {
        let shape: [usize; D] = self.shape(name).try_into().expect("that many axes");
        Tensor::from_data(TensorData::new(self.singles(name), shape), device)
    }

    /// Names that begin with `start`, without this prefix.
    pub(crate) fn names(&self, start: &str) -> Vec<&str> {
        self.tensors
            .keys()
            .filter_map(|name| name.strip_prefix(start))
            .collect()
    }

    /// Term of the output `name` in the objective whose gradients the case holds.
    pub(crate) fn towards<const D: usize>(&self, name: &str, output: Tensor<D>) -> Tensor<1> {
        let towards = self.tensor::<D>(&format!("towards.{name}"), &output.device());
        (output * towards).sum()
    }

    /// The case's joint tree.
    pub(crate) fn skeleton(&self) -> Skeleton {
        let rest = self.numbers("rest").chunks_exact(3);
        Skeleton {
            names: self.joint_names.clone(),
            parents: self
                .numbers("parents")
                .iter()
                .map(|p| (*p >= 0.0).then_some(*p as usize))
                .collect(),
            rest: rest.map(|p| [p[0], p[1], p[2]]).collect(),
        }
    }

    /// The case's pose.
    pub(crate) fn pose(&self) -> Pose {
        let translated = self.tensors.contains_key("translation");
        Pose {
            rotations: self
                .singles("pose")
                .chunks_exact(3)
                .map(|r| [r[0], r[1], r[2]])
                .collect(),
            translation: if translated {
                self.vector("translation")
            } else {
                [0.0; 3]
            },
        }
    }
}

fn chunks<const N: usize>(bytes: &[u8], read: impl Fn([u8; N]) -> f64) -> Vec<f64> {
    bytes.as_chunks::<N>().0.iter().map(|b| read(*b)).collect()
}
