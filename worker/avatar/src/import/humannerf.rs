//! Checkpoints of the released HumanNeRF program as models of one identity.
//!
//! Its layers read the pose and an encoding as one concatenated input; ours keep a matrix for
//! each. Importing therefore cuts and transposes matrices, and no number changes.

use super::joints::SMPL;
use super::tensors::Tensors;
use super::{HumanNerfOptions, ImportError, read_canonical_joints};
use crate::avatar::Avatar;
use crate::config::{
    Appearance, DensityActivation, FieldConfig, LayersConfig, ModelConfig, MotionForm, Numerics,
};
use crate::init;
use crate::train::{ModelState, TrainError, save_model};
use burn::module::{Module, ModuleMapper, Param, ParamId};
use burn::tensor::{Device, Tensor, TensorData};
use std::collections::HashMap;
use std::ops::Range;
use std::path::Path;
use yoto_capture::skeleton::{Skeleton, Vec3};

/// Bones with a rotation of their own, three numbers each, in the pose vector.
const POSE: usize = 3 * (SMPL.len() - 1);
/// Channels of the motion weights: the bones and the background.
const CHANNELS: usize = SMPL.len() + 1;

/// What was imported.
#[derive(Clone, Debug, PartialEq)]
pub struct Imported {
    /// Iterations it was trained for, where the checkpoint says so.
    pub iteration: Option<u64>,
    /// Canonical position of the pelvis, metres: `joints` as their file has them.
    pub root: Vec3,
    /// Numbers in all its tensors.
    pub parameters: u64,
}

/// Reads `checkpoint` and the canonical joints in `joints`, and writes a model of one identity
/// to the folder `out`: its weights and its state, which render but don't train on.
///
/// # Errors
/// When a file can't be read, a tensor is missing or does not have its shape in HumanNeRF's
/// networks with these widths, an option is out of its range, or the folder can't be written.
pub fn import_humannerf(
    checkpoint: &Path,
    joints: &Path,
    out: &Path,
    options: &HumanNerfOptions,
) -> Result<Imported, ImportError> {
    let rest = read_canonical_joints(joints)?;
    let mut tensors = Tensors::open(checkpoint)?;
    let config = config_of(&tensors, options);
    let mut layers = Layers {
        tensors: &mut tensors,
        values: HashMap::new(),
    };
    layers.decoder(&config.motion.form);
    let correction = LayersConfig {
        width: config.correction.width,
        depth: config.correction.depth,
        skip: None,
        inject: 0,
    };
    layers.correction(&correction);
    layers.non_rigid(&config.non_rigid.layers, 6 * config.non_rigid.bands);
    match &config.appearance {
        Appearance::Field(FieldConfig { canonical, .. }) => {
            layers.canonical(&canonical.layers, 3 + 6 * canonical.encoding.bands());
        }
        // `ModelConfig::humannerf` has a field.
        Appearance::Splats(_) => {}
    }
    let values = layers.values;
    let iteration = tensors.iteration;
    tensors.finish(checkpoint)?;
    config.check().map_err(TrainError::from)?;

    let root = rest.first().copied().unwrap_or_default();
    let skeleton = Skeleton {
        names: SMPL.iter().map(|(name, _)| (*name).to_owned()).collect(),
        parents: SMPL.iter().map(|(_, parent)| *parent).collect(),
        rest,
    };
    let blank = Avatar::new(&config, 1, SMPL.len(), 0, &Device::flex());
    let mut fill = Fill {
        values,
        left_out: 0,
    };
    let avatar = blank.map(&mut fill);
    if fill.left_out > 0 || !fill.values.is_empty() {
        return Err(ImportError::file(
            checkpoint,
            "its layers are not those of a model with these widths",
        ));
    }
    std::fs::create_dir_all(out).map_err(|error| ImportError::file(out, error))?;
    let state = ModelState {
        step: iteration.unwrap_or(0),
        // The released program renders with everything open, whatever the iteration.
        schedule_progress: 1.0,
        ..ModelState::new(config, SMPL.len(), 0, vec![Some(skeleton)])
    };
    save_model(out, &state, &avatar)?;
    Ok(Imported {
        iteration,
        root,
        parameters: avatar.num_params() as u64,
    })
}

/// HumanNeRF's configuration with `options` and the widths of the tensors.
fn config_of(tensors: &Tensors, options: &HumanNerfOptions) -> ModelConfig {
    let extent = |name: &str, axis: usize, default: usize| {
        tensors.shape(name).get(axis).copied().unwrap_or(default)
    };
    let mut config = ModelConfig::humannerf();
    config.numerics = Numerics::Reference;
    // Shares of a run that is long enough to open all bands.
    let schedule = &mut config.schedule;
    schedule.steps = schedule.steps.max(options.full_band);
    schedule.non_rigid = options.kick_in as f64 / schedule.steps as f64;
    schedule.all_bands = options.full_band as f64 / schedule.steps as f64;
    if let MotionForm::Deconv {
        embedding,
        hidden,
        channels,
    } = &mut config.motion.form
    {
        let linear = "mweight_vol_decoder.decoder.block_mlp.0.weight";
        *hidden = extent(linear, 0, *hidden);
        *embedding = extent(linear, 1, *embedding);
        for (layer, width) in channels.iter_mut().enumerate() {
            *width = extent(&kernel(layer), 1, *width);
        }
    }
    let width = |name: &str, default: usize| extent(name, 0, default);
    let layers = &mut config.non_rigid.layers;
    layers.width = width("non_rigid_mlp.block_mlps.2.weight", layers.width);
    match &mut config.appearance {
        Appearance::Field(FieldConfig { canonical, march }) => {
            canonical.activation = DensityActivation::Relu;
            canonical.layers.width = width("cnl_mlp.pts_linears.2.weight", canonical.layers.width);
            march.samples = options.samples;
        }
        // `ModelConfig::humannerf` has a field.
        Appearance::Splats(_) => {}
    }
    config.correction.width = width("pose_decoder.block_mlps.2.weight", config.correction.width);
    config
}

fn kernel(layer: usize) -> String {
    // Activations take every other place.
    format!(
        "mweight_vol_decoder.decoder.block_conv.{}.weight",
        2 * layer
    )
}

/// Collects the numbers of our parameters.
struct Layers<'a> {
    tensors: &'a mut Tensors,
    values: HashMap<ParamId, Vec<f32>>,
}

impl Layers<'_> {
    fn put(&mut self, path: &str, values: Vec<f32>) {
        self.values.insert(init::id(path), values);
    }

    fn same(&mut self, path: &str, name: &str, shape: &[usize]) {
        let values = self.tensors.take(name, shape);
        self.put(path, values);
    }

    /// A fully connected layer `name` of `[output, input]`; `parts` are our matrices and the
    /// columns of each.
    fn linear(&mut self, path: &str, name: &str, output: usize, parts: &[(&str, Range<usize>)]) {
        let input = parts.iter().map(|(_, columns)| columns.len()).sum();
        let weight = self
            .tensors
            .take(&format!("{name}.weight"), &[output, input]);
        for (part, columns) in parts {
            let values = columns
                .clone()
                .flat_map(|column| weight.iter().skip(column).step_by(input.max(1)).copied())
                .collect();
            self.put(&format!("{path}.{part}"), values);
        }
        self.same(&format!("{path}.bias"), &format!("{name}.bias"), &[output]);
    }

    fn decoder(&mut self, form: &MotionForm) {
        let MotionForm::Deconv {
            embedding,
            hidden,
            channels,
        } = form
        else {
            return;
        };
        let block = "mweight_vol_decoder.decoder";
        self.same(
            "motion.decoder.embeddings.0",
            "mweight_vol_decoder.const_embedding",
            &[*embedding],
        );
        let weight = self.tensors.take(
            &format!("{block}.block_mlp.0.weight"),
            &[*hidden, *embedding],
        );
        let transposed = (0..*embedding)
            .flat_map(|column| weight.iter().skip(column).step_by(*embedding).copied())
            .collect();
        self.put("motion.decoder.linear", transposed);
        self.same(
            "motion.decoder.bias",
            &format!("{block}.block_mlp.0.bias"),
            &[*hidden],
        );
        let inputs = [*hidden].into_iter().chain(channels.iter().copied());
        let outputs = channels.iter().copied().chain([CHANNELS]);
        for (layer, (input, output)) in inputs.zip(outputs).enumerate() {
            self.same(
                &format!("motion.decoder.kernels.{layer}"),
                &kernel(layer),
                &[input, output, 4, 4, 4],
            );
            self.same(
                &format!("motion.decoder.biases.{layer}"),
                &format!("{block}.block_conv.{}.bias", 2 * layer),
                &[output],
            );
        }
    }

    fn correction(&mut self, layers: &LayersConfig) {
        let block = "pose_decoder.block_mlps";
        for layer in 0..=layers.depth {
            let input = if layer == 0 { POSE } else { layers.width };
            let (path, output) = if layer == layers.depth {
                ("correction.output".to_owned(), POSE)
            } else {
                (format!("correction.{layer}"), layers.width)
            };
            let name = format!("{block}.{}", 2 * layer);
            self.linear(&path, &name, output, &[("weight", 0..input)]);
        }
    }

    /// The pose comes first in the first layer, the encoding last in the skip.
    fn non_rigid(&mut self, layers: &LayersConfig, encoding: usize) {
        let block = "non_rigid_mlp.block_mlps";
        let width = layers.width;
        for layer in 0..layers.depth {
            let name = format!("{block}.{}", 2 * layer);
            let path = format!("non_rigid.{layer}");
            let mut parts = if layer == 0 {
                vec![("code", 0..POSE), ("weight", POSE..POSE + encoding)]
            } else {
                vec![("weight", 0..width)]
            };
            if layers.skip == Some(layer) {
                parts.push(("skip", width..width + encoding));
            }
            self.linear(&path, &name, width, &parts);
        }
        let name = format!("{block}.{}", 2 * layers.depth);
        self.linear("non_rigid.output", &name, 3, &[("weight", 0..width)]);
    }

    /// The encoding comes first in the skip.
    fn canonical(&mut self, layers: &LayersConfig, encoding: usize) {
        let width = layers.width;
        for layer in 0..layers.depth {
            let name = format!("cnl_mlp.pts_linears.{}", 2 * layer);
            let path = format!("canonical.{layer}");
            if layer == 0 {
                self.linear(&path, &name, width, &[("weight", 0..encoding)]);
            } else if layers.skip == Some(layer) {
                let parts = [
                    ("skip", 0..encoding),
                    ("weight", encoding..encoding + width),
                ];
                self.linear(&path, &name, width, &parts);
            } else {
                self.linear(&path, &name, width, &[("weight", 0..width)]);
            }
        }
        let name = "cnl_mlp.output_linear.0";
        self.linear("canonical.output", name, 4, &[("weight", 0..width)]);
    }
}

/// Replaces a model's parameters by numbers.
struct Fill {
    values: HashMap<ParamId, Vec<f32>>,
    left_out: usize,
}

impl ModuleMapper for Fill {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        match self.values.remove(&param.id) {
            Some(values) if values.len() == param.val().dims().iter().product::<usize>() => param
                .map(|blank| {
                    Tensor::from_data(TensorData::new(values, blank.dims()), &blank.device())
                }),
            _ => {
                self.left_out += 1;
                param
            }
        }
    }
}
