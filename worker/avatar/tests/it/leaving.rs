//! Somebody leaves a model: nothing of theirs is left in its files, and everybody else is as before.

use crate::support;
use crate::support::{options, run, tempdir, weights};
use burn::tensor::Device;
use burn_pack::Reader;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use yoto_avatar::config::{ModelConfig, Refine};
use yoto_avatar::render::{RenderView, Rendered, Renderer};
use yoto_avatar::train::leaving::{Residue, SharedWeights, remove_person};
use yoto_avatar::train::{Learn, ModelState, TrainOptions, TrainPerson, Trainer};
use yoto_capture::camera::Pose;
use yoto_proto::manifest::files;
use yoto_synthetic::SyntheticPerson;

const SIZE: u32 = 48;

fn people(slots: &[usize]) -> Vec<TrainPerson> {
    support::people(slots, 12, SIZE)
}

fn config(tier: &str) -> ModelConfig {
    let mut config = ModelConfig::named(tier, "yoto").expect("a tier");
    config.refinement.who = Refine::Always;
    config.optimise.patches = 4;
    if let Some(splats) = config.appearance.splats_mut() {
        (splats.count, splats.coarse) = (1500, 1000);
    }
    config
}

fn joining(slot: usize) -> TrainOptions {
    TrainOptions {
        learn: Learn::Own { slot },
        ..options(6)
    }
}

/// A model of the people in slots 0 and 1; the person in slot 2 joined later.
fn trio(tier: &str, dir: &Path) {
    let device = Device::flex();
    let mut trainer =
        Trainer::new(config(tier), options(10), people(&[0, 1]), &device).expect("starts");
    run(&mut trainer, 10);
    trainer.save(dir).expect("saves");
    let mut trainer = Trainer::resume(dir, joining(2), people(&[2]), &device).expect("joins");
    run(&mut trainer, 6);
    trainer.save(dir).expect("saves");
    std::fs::write(dir.join(files::PREVIEW), "everybody").expect("written");
}

fn picture(dir: &Path, slot: usize) -> Result<Rendered, String> {
    let renderer = Renderer::load(dir, &Device::flex()).expect("a model");
    let view = RenderView {
        slot,
        pose: Pose::rest(24),
        camera: SyntheticPerson::held_out_cameras(SIZE).remove(0),
        background: [0.2; 3],
    };
    renderer.render(&view).map_err(|error| error.to_string())
}

/// The bytes of each tensor of the optimiser.
fn moments(dir: &Path) -> BTreeMap<String, Vec<u8>> {
    let reader = Reader::from_file(dir.join(files::OPTIMISER)).expect("a pack");
    let tensors = reader.into_tensors().expect("tensors").into_iter();
    let parts = tensors.map(|tensor| tensor.into_parts().expect("a tensor"));
    parts
        .map(|(name, .., bytes)| (name, bytes.to_vec()))
        .collect()
}

#[test]
fn who_leaves_leaves_nothing_and_everybody_else_is_as_before() {
    for tier in ["draft", "splat"] {
        let (before, parent) = (tempdir(), tempdir());
        trio(tier, before.path());
        for (slot, shared_weights, others) in [
            (2, SharedWeights::NeverSawThem, [0, 1]),
            (0, SharedWeights::SawThem, [1, 2]),
        ] {
            let after = parent.path().join(format!("without-{slot}"));
            let certificate = remove_person(before.path(), &after, slot).expect("leaves");
            assert_eq!(
                (certificate.shared_weights, certificate.slot),
                (shared_weights, slot),
                "{tier}"
            );
            assert!(certificate.searched > 50, "{tier}: {certificate:?}");
            let theirs = [files::refined_poses(slot), files::PREVIEW.to_owned()];
            assert_eq!(certificate.removed.files, theirs, "{tier}");
            let said = serde_json::to_string(&certificate).expect("JSON");
            let word = ["private_only", "trunk_saw_them"][usize::from(slot == 0)];
            assert!(said.contains(word), "{said}");

            let (old, new) = (weights(before.path()), weights(&after));
            assert_eq!(old.len() - new.len(), certificate.removed.tensors.len());
            assert!(new.iter().all(|(name, it)| old[name] == *it), "{tier}");
            let (old, new) = (moments(before.path()), moments(&after));
            assert_eq!(old.len() - new.len(), certificate.removed.moments);
            assert!(certificate.removed.moments > 0, "{tier}");
            assert!(new.iter().all(|(name, it)| old[name] == *it), "{tier}");
            for other in others {
                let of = |dir: &Path| picture(dir, other).expect("renders").rgb;
                assert!(of(before.path()) == of(&after), "{tier}: slot {other}");
            }
            let why = picture(&after, slot).expect_err("nobody is there");
            assert!(why.contains("was removed"), "{why}");
            let state = ModelState::read(&after).expect("a state");
            assert_eq!(state.erased, [slot].into(), "{tier}");
            assert_eq!(state.slots[slot], None, "{tier}");
        }
    }
}

/// Whether a piece of `bytes` has many different values: constants tell nobody apart.
fn tells(bytes: &[u8]) -> bool {
    let different = |piece: &[u8]| piece.iter().collect::<BTreeSet<_>>().len();
    bytes.chunks_exact(32).any(|piece| different(piece) >= 14)
}

/// Each kind of leftover is planted, and found.
#[test]
fn the_search_finds_what_is_left() {
    for tier in ["draft", "splat"] {
        let (before, parent) = (tempdir(), tempdir());
        trio(tier, before.path());
        let state = ModelState::read(before.path()).expect("a state");
        let residue = Residue::of(before.path(), &state, 2).expect("readable");
        let after = parent.path().join("after");
        remove_person(before.path(), &after, 2).expect("leaves");
        assert_eq!(residue.search(&after).expect("readable"), [], "{tier}");
        // All of it is found where it comes from.
        let there = residue.search(before.path()).expect("readable");
        assert!(there.len() >= residue.len(), "{tier}: {}", there.len());

        let plant = |file: &str, bytes: &[u8]| {
            std::fs::write(after.join(file), bytes).expect("written");
            let found = residue.search(&after).expect("readable");
            std::fs::remove_file(after.join(file)).expect("there");
            found.into_iter().map(|it| it.what).collect::<Vec<String>>()
        };
        // Every kind of tensor, shifted by three bytes as in a file with another header.
        let shifted = |bytes: &[u8]| [&[7; 3], bytes].concat();
        let (kept, gone) = (weights(before.path()), weights(&after));
        let own: Vec<_> = kept.iter().filter(|it| !gone.contains_key(it.0)).collect();
        let mut planted = 0;
        for (name, bytes) in own.into_iter().filter(|it| tells(it.1)) {
            let found = plant("weights.old", &shifted(bytes));
            let found = found.iter().any(|it| it.contains(name.as_str()));
            assert!(found, "{tier}: {name}");
            planted += 1;
        }
        assert!(planted > 0, "{tier}");
        let (kept, gone) = (moments(before.path()), moments(&after));
        let theirs: Vec<_> = kept.iter().filter(|it| !gone.contains_key(it.0)).collect();
        let mut planted = 0;
        for (name, bytes) in theirs.into_iter().filter(|it| tells(it.1)) {
            // One that somebody else has too is no evidence.
            let found = plant("optimiser.old", &shifted(bytes));
            let found = found.iter().any(|it| it.contains(name.as_str()));
            assert!(
                found || gone.values().any(|other| other == bytes),
                "{tier}: {name}"
            );
            planted += usize::from(found);
        }
        assert!(planted > 0, "{tier}");
        let track = files::refined_poses(2);
        let bytes = std::fs::read(before.path().join(&track)).expect("there");
        assert!(!plant(&track, &bytes).is_empty(), "{tier}");
        let json = serde_json::to_vec(&state.slots[2]).expect("JSON");
        let found = plant("body.json", &json);
        assert!(
            found.iter().any(|it| it.contains("measure")),
            "{tier}: {found:?}"
        );
    }
}

#[test]
fn a_model_that_a_person_left_is_trained_on_without_them() {
    let device = Device::flex();
    for tier in ["draft", "splat"] {
        let (before, parent) = (tempdir(), tempdir());
        trio(tier, before.path());
        let after = parent.path().join("after");
        remove_person(before.path(), &after, 1).expect("leaves");
        let mut trainer =
            Trainer::resume(&after, options(3), people(&[0, 2]), &device).expect("goes on");
        run(&mut trainer, 3);
        trainer.save(&after).expect("saves");
        let names = weights(&after);
        let theirs: Vec<&String> = (names.keys())
            .filter(|name| name.split('.').any(|part| part == "1") && !name.contains("mlp"))
            .filter(|name| !name.contains("layers"))
            .collect();
        assert_eq!(theirs, Vec::<&String>::new(), "{tier}");
        assert!(picture(&after, 1).expect_err("nobody").contains("removed"));
        let again = Trainer::resume(&after, options(3), people(&[0, 1]), &device);
        let why = again.err().expect("refused").to_string();
        assert!(why.contains("never used again"), "{why}");
        let mut trainer =
            Trainer::resume(&after, joining(3), people(&[3]), &device).expect("joins");
        run(&mut trainer, 1);
        trainer.save(&after).expect("saves");
        picture(&after, 3).expect("renders");
    }
}

#[test]
fn what_can_not_be_removed_says_why() {
    let (before, parent) = (tempdir(), tempdir());
    trio("draft", before.path());
    let after = parent.path().join("after");
    let why = |from: &Path, to: &Path, slot: usize| {
        let refused = remove_person(from, to, slot).expect_err("refused");
        refused.to_string()
    };
    let said = why(before.path(), &after, 7);
    assert!(said.contains("nobody in slot 7, only in 0, 1, 2"), "{said}");
    let said = why(before.path(), parent.path(), 1);
    assert!(said.contains("exists"), "{said}");
    remove_person(before.path(), &after, 1).expect("leaves");
    let said = why(&after, &parent.path().join("again"), 1);
    assert!(said.contains("already"), "{said}");
    // A file that was cut is not taken for one that somebody left.
    let mut all = std::fs::read(after.join(files::STATE)).expect("there");
    let text = String::from_utf8(std::mem::take(&mut all)).expect("JSON");
    let forged = text.replace("\"erased\": [\n    1\n  ]", "\"erased\": []");
    assert_ne!(forged, text);
    std::fs::write(after.join(files::STATE), forged).expect("written");
    let torn = Renderer::load(&after, &Device::flex()).err();
    let said = torn.expect("refused").to_string();
    assert!(said.contains("missing tensor"), "{said}");
}
