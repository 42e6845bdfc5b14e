//! The small complete model of `tests/reference/model.py`, with its weights.

use crate::parity::case::path;
use burn::module::{Module, ModuleMapper, Param};
use burn::store::{ModuleSnapshot, SafetensorsStore};
use burn::tensor::{Device, Tensor};
use yoto_avatar::avatar::Avatar;
use yoto_avatar::config::{Encoding, LayersConfig, ModelConfig, Unposing};

/// Joints of the small tree.
const JOINTS: usize = 5;
/// Identities of the small model.
const SLOTS: usize = 2;
/// Progress of the reference, step 60 of 100, at which half of the bands are open.
pub(crate) const PROGRESS: f64 = 0.6;

/// The Fourier encoding of the small model.
pub(crate) const FOURIER: Encoding = Encoding::Fourier { bands: 4 };
/// The hash grid of the small model: one dense level, then hashed ones.
pub(crate) const HASH: Encoding = Encoding::Hash {
    levels: 3,
    base: 4,
    growth: 1.6,
    log2_rows: 7,
    features: 2,
    own_log2_rows: 7,
};

/// Device of the tests.
pub(crate) fn device() -> Device {
    Device::flex().autodiff()
}

/// Sizes and rates. All samples are evaluated, so that no result depends on a threshold.
pub(crate) fn config(encoding: Encoding) -> ModelConfig {
    let mut config = ModelConfig::named("draft", "yoto").expect("a tier");
    config.code_width = 8;
    config.motion.resolution = 10.into();
    // The reference is the paper's.
    config.motion.unposing = Unposing::Blend;
    config.correction.width = 12;
    config.correction.depth = 2;
    config.schedule = config.schedule.all_at_once();
    config.condition.bands = 3;
    config.non_rigid.bands = 3;
    config.schedule.all_bands = 1.0;
    config.non_rigid.layers = LayersConfig {
        width: 16,
        depth: 4,
        skip: Some(2),
        inject: 1,
    };
    let field = config.appearance.field_mut().expect("a field");
    field.canonical.encoding = encoding;
    field.canonical.density_scale = 8.0;
    field.canonical.layers = LayersConfig {
        width: 16,
        depth: 4,
        skip: Some(2),
        inject: 2,
    };
    field.march.samples = 12;
    field.march.epsilon = 0.0;
    field.march.min_transmittance = 0.0;
    config.optimise.rate = 2e-3;
    config.optimise.table_rate = 1e-2;
    config.optimise.motion_rate = 4e-3;
    config.optimise.slow_rate = 5e-4;
    config.optimise.ssim_weight = 0.1;
    // The reference has no such term.
    config.optimise.mask_weight = 0.0;
    config.check().expect("a possible model");
    config
}

/// The model with the reference's weights, read like those of a checkpoint.
pub(crate) fn avatar(config: &ModelConfig) -> Avatar {
    let file = match config.appearance.encoding().expect("a field") {
        Encoding::Fourier { .. } => "model-fourier",
        Encoding::Hash { .. } => "model-hash",
    };
    avatar_with(config, file)
}

/// Path of the table that people share, which the reference lacks: its people have tables alone.
pub(crate) const SHARED_TABLE: &str = "canonical.shared";

/// Empties the table that people share.
#[derive(Default)]
struct Empty {
    path: Vec<String>,
}

impl ModuleMapper for Empty {
    fn enter_module(&mut self, name: &str, _: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.pop();
    }

    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        match self.path.join(".") == SHARED_TABLE {
            true => param.map(|table| table.zeros_like().require_grad()),
            false => param,
        }
    }
}

/// The model with the weights in `file`, which may lack some.
pub(crate) fn avatar_with(config: &ModelConfig, file: &str) -> Avatar {
    let mut avatar = Avatar::new(config, SLOTS, JOINTS, 0, &device());
    let mut store = SafetensorsStore::from_file(path(file)).allow_partial(true);
    let loaded = avatar.load_from(&mut store).expect("weights that fit");
    assert!(loaded.unused.is_empty(), "{:?}", loaded.unused);
    avatar.map(&mut Empty::default())
}
