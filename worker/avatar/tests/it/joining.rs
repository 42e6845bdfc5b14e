//! Somebody joins a trained model: they learn, and nothing else changes by a bit.

use crate::support;
use crate::support::{options, run, tempdir, weights};
use burn::tensor::Device;
use burn_pack::Reader;
use std::collections::BTreeMap;
use std::path::Path;
use yoto_avatar::config::{ModelConfig, Refine};
use yoto_avatar::render::{RenderView, Renderer};
use yoto_avatar::train::{
    Budget, Learn, ModelState, TrainOptions, TrainPerson, Trainer, Validation,
};
use yoto_capture::camera::Pose;
use yoto_proto::manifest::files;
use yoto_synthetic::SyntheticPerson;

const SIZE: u32 = 48;
/// Steps of the two who are there, and of the one who joins.
const STEPS: u64 = 12;

fn people(slots: &[usize]) -> Vec<TrainPerson> {
    support::people(slots, 12, SIZE)
}

/// A small model of a tier, whose poses are refined, so that there are files to keep.
fn config(tier: &str) -> ModelConfig {
    let mut config = ModelConfig::named(tier, "yoto").expect("a tier");
    config.refinement.who = Refine::Always;
    config.optimise.patches = 4;
    if let Some(splats) = config.appearance.splats_mut() {
        (splats.count, splats.coarse) = (1500, 1000);
    }
    config
}

/// A trained model of the people in slots 0 and 1.
fn duo(tier: &str, dir: &Path) {
    let mut trainer = Trainer::new(
        config(tier),
        options(STEPS),
        people(&[0, 1]),
        &Device::flex(),
    )
    .expect("starts");
    run(&mut trainer, STEPS as usize);
    trainer.save(dir).expect("saves");
}

fn joining(used_steps: u64) -> TrainOptions {
    TrainOptions {
        learn: Learn::Own { slot: 2 },
        used_steps,
        ..options(STEPS)
    }
}

/// The bytes of the moments of each parameter, and of how often it was stepped.
fn moments(dir: &Path) -> BTreeMap<String, Vec<u8>> {
    let reader = Reader::from_file(dir.join(files::OPTIMISER)).expect("a pack");
    let steps = reader.scalars().clone();
    let mut found: BTreeMap<String, Vec<u8>> = (steps.iter())
        .map(|(name, value)| (name.clone(), format!("{value:?}").into_bytes()))
        .collect();
    for tensor in reader.into_tensors().expect("tensors") {
        let (name, _, _, _, bytes) = tensor.into_parts().expect("a tensor");
        found.insert(name, bytes.to_vec());
    }
    found
}

fn picture(dir: &Path, slot: usize) -> Vec<f32> {
    let renderer = Renderer::load(dir, &Device::flex()).expect("a model");
    let view = RenderView {
        slot,
        pose: Pose::rest(24),
        camera: SyntheticPerson::held_out_cameras(SIZE).remove(0),
        background: [0.2; 3],
    };
    renderer.render(&view).expect("renders").rgb
}

#[test]
fn who_joins_learns_and_nobody_else_changes_by_a_bit() {
    for tier in ["draft", "splat"] {
        let (before, after) = (tempdir(), tempdir());
        duo(tier, before.path());
        let mut trainer =
            Trainer::resume(before.path(), joining(0), people(&[2]), &Device::flex()).expect(tier);
        run(&mut trainer, STEPS as usize);
        assert!(trainer.finished(), "{tier}");
        trainer.save(after.path()).expect("saves");

        let (old, new) = (weights(before.path()), weights(after.path()));
        let changed: Vec<_> = old.iter().filter(|(name, it)| new[*name] != **it).collect();
        assert_eq!(changed, [], "{tier}: weights changed");
        let (kept, grown) = (moments(before.path()), moments(after.path()));
        let changed: Vec<_> = kept
            .iter()
            .filter(|(name, it)| grown[*name] != **it)
            .collect();
        assert_eq!(changed, [], "{tier}: moments changed");
        assert!(new.len() > old.len() && grown.len() > kept.len(), "{tier}");
        for slot in [0, 1] {
            let file = files::refined_poses(slot);
            let read = |dir: &Path| std::fs::read(dir.join(&file)).expect("kept");
            assert!(read(before.path()) == read(after.path()), "{tier}: {file}");
            let (was, is) = (picture(before.path(), slot), picture(after.path(), slot));
            assert!(was == is, "{tier}: slot {slot} renders differently");
            assert!(was.iter().any(|v| *v != 0.2), "{tier}: nobody is seen");
        }
        let joined = ModelState::read(after.path()).expect("a state");
        assert_eq!(joined.own_only, [2].into(), "{tier}");
        assert_eq!(joined.config, config(tier), "{tier}");
    }
}

#[test]
fn the_person_who_joins_gets_better() {
    for tier in ["draft", "splat"] {
        let dir = tempdir();
        duo(tier, dir.path());
        let options = TrainOptions {
            validation: Validation::Every(6),
            // The poses are exact.
            refine_poses: Some(Refine::Never),
            budget: Budget::Steps(60),
            ..joining(0)
        };
        let mut trainer =
            Trainer::resume(dir.path(), options, people(&[2]), &Device::flex()).expect(tier);
        trainer.validate().expect("validates");
        let before = trainer.progress().psnr.expect("held-out frames");
        run(&mut trainer, 60);
        trainer.validate().expect("validates");
        let after = trainer.progress().psnr.expect("held-out frames");
        println!("{tier}: {before:.2} to {after:.2} dB");
        assert!(after > before + 1.0, "{tier}: {before:.2} to {after:.2} dB");
    }
}

#[test]
fn a_joining_that_is_resumed_ends_bit_for_bit_where_an_uninterrupted_one_does() {
    for tier in ["draft", "splat"] {
        let (before, half, straight, resumed) = (tempdir(), tempdir(), tempdir(), tempdir());
        duo(tier, before.path());
        let mut trainer =
            Trainer::resume(before.path(), joining(0), people(&[2]), &Device::flex()).expect(tier);
        run(&mut trainer, 5);
        trainer.save(half.path()).expect("saves");
        run(&mut trainer, 7);
        trainer.save(straight.path()).expect("saves");
        let mut again =
            Trainer::resume(half.path(), joining(5), people(&[2]), &Device::flex()).expect(tier);
        run(&mut again, 7);
        again.save(resumed.path()).expect("saves");
        let (one, other) = (weights(straight.path()), weights(resumed.path()));
        let changed: Vec<_> = one
            .iter()
            .filter(|(name, it)| other[*name] != **it)
            .collect();
        assert_eq!(changed, [], "{tier}");
        assert_eq!(moments(straight.path()), moments(resumed.path()), "{tier}");
        let state = ModelState::read(resumed.path()).expect("a state");
        assert_eq!(state.own_only, [2].into(), "{tier}");
    }
}

#[test]
fn trained_with_everybody_a_person_is_no_longer_only_their_own() {
    let (joined, all) = (tempdir(), tempdir());
    duo("draft", joined.path());
    let device = Device::flex();
    let mut trainer =
        Trainer::resume(joined.path(), joining(0), people(&[2]), &device).expect("joins");
    run(&mut trainer, 2);
    trainer.save(joined.path()).expect("saves");
    let mut trainer =
        Trainer::resume(joined.path(), options(2), people(&[0, 1, 2]), &device).expect("goes on");
    run(&mut trainer, 2);
    trainer.save(all.path()).expect("saves");
    assert!(ModelState::read(joined.path()).expect("a state").own_only == [2].into());
    let state = ModelState::read(all.path()).expect("a state");
    assert!(state.own_only.is_empty());
    let (old, new) = (weights(joined.path()), weights(all.path()));
    assert!(
        old["motion.base"] != new["motion.base"],
        "the shared weights learn again"
    );
}

#[test]
fn what_can_not_be_joined_says_why() {
    let device = Device::flex();
    let why = |trainer: Result<Trainer, yoto_avatar::train::TrainError>| {
        trainer.err().expect("refused").to_string()
    };
    let new = Trainer::new(config("draft"), joining(0), people(&[2]), &device);
    assert!(why(new).contains("train it first"));
    let dir = tempdir();
    duo("draft", dir.path());
    let two = Trainer::resume(dir.path(), joining(0), people(&[1, 2]), &device);
    assert!(why(two).contains("2 people"));
    let other = Trainer::resume(dir.path(), joining(0), people(&[3]), &device);
    assert!(why(other).contains("slot 3, not in slot 2"));
    let shared = ModelConfig::named("draft", "no-identity").expect("a tier");
    let mut trainer = Trainer::new(shared, options(1), people(&[0]), &device).expect("starts");
    run(&mut trainer, 1);
    trainer.save(dir.path()).expect("saves");
    let nobody = Trainer::resume(dir.path(), joining(0), people(&[2]), &device);
    assert!(why(nobody).contains("no-identity"));
}
