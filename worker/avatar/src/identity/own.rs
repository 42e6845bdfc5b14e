//! The owner of each parameter: a model has parameters of each person, and shared weights.

use super::stored_names::stored;
use crate::avatar::Avatar;
use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::Tensor;

/// Names in checkpoints of the lists with the parameters of each person, one entry per slot.
const OWN: [&str; 7] = [
    "codes",
    "motion.residuals",
    "motion.decoder.embeddings",
    "canonical.tables",
    "splats",
    "pose_shapes.own",
    "pose_shapes.filmed",
];

/// The slot of the person who owns the parameter that checkpoints call `path`, as in `splats.2.means`; `None` for
/// shared weights.
pub(crate) fn owner(path: &str) -> Option<usize> {
    let within = |lists: &&str| path.strip_prefix(*lists)?.strip_prefix('.');
    let rest = OWN.iter().find_map(within)?;
    let (slot, _) = rest.split_once('.').unwrap_or((rest, ""));
    slot.parse().ok()
}

/// Paths of all parameters by the program's fields ([`stored`] gives their names in checkpoints).
pub(crate) fn paths(avatar: &Avatar) -> Vec<String> {
    let mut paths = Paths::default();
    avatar.visit(&mut paths);
    paths.found
}

#[derive(Default)]
struct Paths {
    path: Vec<String>,
    found: Vec<String>,
}

impl ModuleVisitor for Paths {
    fn enter_module(&mut self, name: &str, _: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.pop();
    }

    fn visit_float<const D: usize>(&mut self, _: &Param<Tensor<D>>) {
        self.found.push(self.path.join("."));
    }
}

/// Makes all parameters but those of the person in `slot` constants. They get no gradients, so that an
/// optimiser leaves them and their moments alone.
pub(crate) fn freeze_all_but(avatar: Avatar, slot: usize) -> Avatar {
    let path = Vec::new();
    avatar.map(&mut Freeze { slot, path })
}

struct Freeze {
    slot: usize,
    path: Vec<String>,
}

impl ModuleMapper for Freeze {
    fn enter_module(&mut self, name: &str, _: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.pop();
    }

    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        match owner(&stored(&self.path.join("."))) == Some(self.slot) {
            true => param,
            false => param.set_require_grad(false),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{ModelConfig, MotionForm, Resolution};
    use burn::module::ParamId;
    use burn::tensor::Device;

    #[test]
    fn lists_of_layers_are_nobodys() {
        assert_eq!(owner("splats.2.means"), Some(2));
        assert_eq!(owner("codes.10"), Some(10));
        assert_eq!(owner("motion.residuals.0"), Some(0));
        for path in [
            "motion.base",
            "motion.decoder.kernels.1",
            "canonical.mlp.weights.1",
            "canonical.shared",
            "codes",
        ] {
            assert_eq!(owner(path), None, "{path}");
        }
    }

    /// The id of each parameter of the person in `slot` with its path.
    fn parameters_of(avatar: &Avatar, slot: usize) -> Vec<(ParamId, String)> {
        let mut found = ParametersOf {
            slot,
            path: Vec::new(),
            parameters: Vec::new(),
        };
        avatar.visit(&mut found);
        found.parameters
    }

    struct ParametersOf {
        slot: usize,
        path: Vec<String>,
        parameters: Vec<(ParamId, String)>,
    }

    impl ModuleVisitor for ParametersOf {
        fn enter_module(&mut self, name: &str, _: &str) {
            self.path.push(name.to_owned());
        }

        fn exit_module(&mut self, _: &str, _: &str) {
            self.path.pop();
        }

        fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
            let path = stored(&self.path.join("."));
            if owner(&path) == Some(self.slot) {
                self.parameters.push((param.id, path));
            }
        }
    }

    /// A further person owns everything that they add to a model, in every form of its parts.
    #[test]
    fn everything_that_a_further_person_adds_is_theirs() {
        let named = |tier: &str| ModelConfig::named(tier, "yoto").expect("a tier");
        let mut decoded = named("draft");
        decoded.motion.form = MotionForm::Deconv {
            embedding: 4,
            hidden: 8,
            channels: vec![4, 4],
        };
        decoded.motion.resolution = Resolution::Cube(8);
        for config in [named("draft"), named("splat"), decoded] {
            let avatar = Avatar::new(&config, 2, 4, 3, &Device::flex());
            let of = |slot| -> usize {
                let ids = parameters_of(&avatar, slot);
                let mut sizes = Sizes { ids, sum: 0 };
                avatar.visit(&mut sizes);
                sizes.sum
            };
            let added = Avatar::parameters_of_a_person(&config, 4);
            assert_eq!(of(1) as u64, added, "{}", config.tier);
            assert_eq!(of(0) as u64, added, "{}", config.tier);
        }
    }

    struct Sizes {
        ids: Vec<(ParamId, String)>,
        sum: usize,
    }

    impl ModuleVisitor for Sizes {
        fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
            if self.ids.iter().any(|(id, _)| *id == param.id) {
                self.sum += param.val().shape().num_elements();
            }
        }
    }
}
