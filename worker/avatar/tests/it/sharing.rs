//! Hash tables that people share: the cost of an additional person, the people whose parameters
//! change when one is trained, and the growth of a model.

use crate::support;
use crate::support::{options, run, tempdir, weights};
use burn::module::{Module, ModuleVisitor, Param};
use burn::tensor::{Device, Tensor};
use std::collections::BTreeMap;
use std::path::Path;
use yoto_avatar::avatar::Avatar;
use yoto_avatar::config::{Encoding, ModelConfig, Sharing};
use yoto_avatar::train::{Person, Trainer};

const SPLIT: Sharing = Sharing::Split { own_log2_rows: 8 };
const BASES: Sharing = Sharing::Bases { count: 4 };

fn config(kind: Sharing, variant: &str) -> ModelConfig {
    let mut config = ModelConfig::named("draft", variant).expect("a tier");
    if let Encoding::Hash {
        sharing, log2_rows, ..
    } = &mut config.canonical.encoding
    {
        *sharing = kind;
        *log2_rows = 10;
    }
    config.optimise.patches = 2;
    config.check().expect("possible");
    config
}

fn people(slots: &[usize]) -> Vec<Person> {
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
fn sizes(sharing: Sharing, variant: &str) -> BTreeMap<String, usize> {
    let avatar = Avatar::new(&config(sharing, variant), 3, 4, 0, &Device::flex());
    let mut sizes = Sizes::default();
    avatar.visit(&mut sizes);
    sizes.found
}

fn names(sizes: &BTreeMap<String, usize>) -> Vec<&str> {
    sizes.keys().map(String::as_str).collect()
}

#[test]
fn a_person_has_what_the_sharing_says_and_is_nobody_in_a_model_without_identities() {
    let own = sizes(Sharing::Own, "yoto");
    let tables = [
        "canonical.tables.0",
        "canonical.tables.1",
        "canonical.tables.2",
    ];
    assert_eq!(names(&own), tables);

    let split = sizes(SPLIT, "yoto");
    assert_eq!(names(&split)[1..], tables);
    assert_eq!(split["canonical.shared"], own[tables[0]]);
    // Six levels of at most 2^8 rows of two.
    assert_eq!(split[tables[2]], 6 * 256 * 2);

    let bases = sizes(BASES, "yoto");
    let mixes = [
        "canonical.mixes.0",
        "canonical.mixes.1",
        "canonical.mixes.2",
    ];
    assert_eq!(names(&bases)[..3], mixes);
    assert_eq!(bases["canonical.shared"], 4 * own[tables[0]]);
    assert_eq!(bases[mixes[0]], 6 * 4, "a coefficient a level and row");

    for sharing in [Sharing::Own, SPLIT, BASES] {
        let found = sizes(sharing, "no-identity");
        let told_apart = names(&found)
            .iter()
            .filter(|name| name.ends_with(".1"))
            .count();
        assert_eq!(told_apart, 0, "{found:?}");
    }
}

#[test]
fn training_somebody_moves_what_is_shared_and_nothing_of_others() {
    for sharing in [SPLIT, BASES] {
        let device = Device::flex();
        let (fresh, trained) = (tempdir(), tempdir());
        let start = |slots: &[usize]| {
            Trainer::new(config(sharing, "yoto"), options(10), people(slots), &device)
                .expect("starts")
        };
        // Only the person in slot 2 is trained; slots 0 and 1 exist.
        let before = train(&mut start(&[2]), 0, fresh.path());
        let after = train(&mut start(&[2]), 4, trained.path());
        for (name, bytes) in before
            .iter()
            .filter(|(name, _)| name.starts_with("canonical."))
        {
            let others = name.ends_with(".0") || name.ends_with(".1");
            let own = name.starts_with("canonical.tables") || name.starts_with("canonical.mixes");
            assert_eq!(after[name] == *bytes, own && others, "{sharing:?}: {name}");
        }
    }
}

#[test]
fn a_model_grows_by_what_a_person_owns() {
    for sharing in [SPLIT, BASES] {
        let device = Device::flex();
        let (two, three) = (tempdir(), tempdir());
        let mut trainer = Trainer::new(
            config(sharing, "yoto"),
            options(10),
            people(&[0, 1]),
            &device,
        )
        .expect("starts");
        let before = train(&mut trainer, 2, two.path());
        let mut trainer = Trainer::resume(two.path(), options(10), people(&[0, 1, 2]), &device)
            .expect("a model of two takes a third");
        let after = train(&mut trainer, 0, three.path());
        for (name, bytes) in &before {
            assert!(after[name] == *bytes, "{sharing:?}: {name}");
        }
        let new: Vec<&String> = after
            .keys()
            .filter(|name| !before.contains_key(*name))
            .collect();
        assert!(!new.is_empty());
        for name in new {
            assert!(name.ends_with(".2"), "{sharing:?}: {name} is new");
        }
    }
}
