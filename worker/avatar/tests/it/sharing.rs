//! Hash tables that people share: the cost of an additional person, the people whose parameters
//! change when one is trained, and the growth of a model.

use crate::support;
use crate::support::{options, run, tempdir, weights};
use burn::module::{Module, ModuleVisitor, Param};
use burn::tensor::{Device, Tensor};
use std::collections::BTreeMap;
use std::path::Path;
use yoto_avatar::avatar::Avatar;
use yoto_avatar::config::{Encoding, ModelConfig};
use yoto_avatar::train::{TrainPerson, Trainer};

fn config(variant: &str) -> ModelConfig {
    let mut config = ModelConfig::named("draft", variant).expect("a tier");
    if let Encoding::Hash {
        own_log2_rows,
        log2_rows,
        ..
    } = &mut config
        .appearance
        .field_mut()
        .expect("a field")
        .canonical
        .encoding
    {
        *own_log2_rows = 8;
        *log2_rows = 10;
    }
    config.optimise.patches = 2;
    config.check().expect("possible");
    config
}

fn people(slots: &[usize]) -> Vec<TrainPerson> {
    support::people(slots, 3, 48)
}

/// The weights after some steps.
fn train(trainer: &mut Trainer, steps: usize, dir: &Path) -> BTreeMap<String, Vec<u8>> {
    run(trainer, steps);
    trainer.save(dir).expect("saves");
    weights(dir)
}

#[derive(Default)]
struct Sizes {
    path: Vec<String>,
    found: BTreeMap<String, usize>,
}

impl ModuleVisitor for Sizes {
    fn enter_module(&mut self, name: &str, _: &str) {
        self.path.push(name.into());
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.pop();
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let path = self.path.join(".");
        let learned = !path.starts_with("canonical.mlp");
        if path.starts_with("canonical.") && learned {
            self.found.insert(path, param.val().shape().num_elements());
        }
    }
}

/// Sizes of the tables' parameters in a model of three people.
fn sizes(variant: &str) -> BTreeMap<String, usize> {
    let avatar = Avatar::new(&config(variant), 3, 4, 0, &Device::flex());
    let mut sizes = Sizes::default();
    avatar.visit(&mut sizes);
    sizes.found
}

#[test]
fn a_person_has_a_small_table_and_is_nobody_in_a_model_without_identities() {
    let found = sizes("yoto");
    let names: Vec<&str> = found.keys().map(String::as_str).collect();
    assert_eq!(
        names,
        [
            "canonical.shared",
            "canonical.tables.0",
            "canonical.tables.1",
            "canonical.tables.2",
        ]
    );
    // Six levels of at most 2^8 rows of two.
    assert_eq!(found["canonical.tables.2"], 6 * 256 * 2);
    assert!(found["canonical.shared"] > found["canonical.tables.2"]);

    let found = sizes("no-identity");
    let own = found.keys().filter(|name| name.ends_with(".1"));
    assert_eq!(own.count(), 0, "{found:?}");
}

#[test]
fn training_a_person_moves_what_is_shared_and_nothing_of_others() {
    let device = Device::flex();
    let (fresh, trained) = (tempdir(), tempdir());
    let start =
        || Trainer::new(config("yoto"), options(10), people(&[2]), &device).expect("starts");
    // Only the person in slot 2 is trained; slots 0 and 1 exist.
    let before = train(&mut start(), 0, fresh.path());
    let after = train(&mut start(), 4, trained.path());
    for (name, bytes) in before
        .iter()
        .filter(|(name, _)| name.starts_with("canonical."))
    {
        let others = name.ends_with(".0") || name.ends_with(".1");
        let own = name.starts_with("canonical.tables");
        assert_eq!(after[name] == *bytes, own && others, "{name}");
    }
}

#[test]
fn a_model_grows_by_what_a_person_owns() {
    let device = Device::flex();
    let (two, three) = (tempdir(), tempdir());
    let mut trainer =
        Trainer::new(config("yoto"), options(10), people(&[0, 1]), &device).expect("starts");
    let before = train(&mut trainer, 2, two.path());
    let mut trainer = Trainer::resume(two.path(), options(10), people(&[0, 1, 2]), &device)
        .expect("a model of two takes a third");
    let after = train(&mut trainer, 0, three.path());
    for (name, bytes) in &before {
        assert!(after[name] == *bytes, "{name}");
    }
    let new: Vec<&String> = after
        .keys()
        .filter(|name| !before.contains_key(*name))
        .collect();
    assert!(!new.is_empty());
    for name in new {
        assert!(name.ends_with(".2"), "{name} is new");
    }
}
