//! What the tests of this package share: made-up people, trainings of them, readers of results.
#![allow(dead_code, reason = "each test binary uses a part of it")]

use burn::tensor::Tensor;
use safetensors::SafeTensors;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use yoto_avatar::train::{Budget, TrainOptions, TrainPerson, Trainer};
use yoto_capture::{FrameImage, Shard, ShardBuilder};
use yoto_proto::manifest::files;
use yoto_proto::pose_track::PoseTrack;
use yoto_synthetic::SyntheticPerson;

/// `made_up`, filmed for `frames` frames of `size` pixels.
pub(crate) fn shard(made_up: &SyntheticPerson, frames: usize, size: u32) -> Shard {
    packed(made_up.capture(frames, size))
}

/// A film, packed.
pub(crate) fn packed((track, images): (PoseTrack, Vec<FrameImage>)) -> Shard {
    let mut builder = ShardBuilder::new(track);
    for image in &images {
        builder.push(image).expect("a synthetic frame is valid");
    }
    builder.finish().expect("all frames are there")
}

/// [`shard`] in a slot of a model.
pub(crate) fn person(
    slot: usize,
    made_up: &SyntheticPerson,
    frames: usize,
    size: u32,
) -> TrainPerson {
    TrainPerson {
        slot,
        name: made_up.name().into(),
        shard: Arc::new(shard(made_up, frames, size)),
    }
}

/// The people of these slots, who are others in every slot and the same in every call.
pub(crate) fn people(slots: &[usize], frames: usize, size: u32) -> Vec<TrainPerson> {
    let needed = slots.iter().max().map_or(0, |slot| slot + 1);
    let cast = SyntheticPerson::cast(needed, 7);
    let slots = slots.iter();
    slots
        .map(|&slot| person(slot, &cast[slot], frames, size))
        .collect()
}

/// A training of `steps` steps on all frames at their own size, without LPIPS.
pub(crate) fn options(steps: u64) -> TrainOptions {
    TrainOptions {
        budget: Budget::Steps(steps),
        seed: 11,
        ..TrainOptions::default()
    }
}

/// Takes `steps` steps.
pub(crate) fn run(trainer: &mut Trainer, steps: usize) {
    for _ in 0..steps {
        trainer.step().expect("a step");
    }
}

/// Bytes of each tensor of the checkpoint in `dir`.
pub(crate) fn weights(dir: &Path) -> BTreeMap<String, Vec<u8>> {
    let bytes = std::fs::read(dir.join(files::WEIGHTS)).expect("written");
    let file = SafeTensors::deserialize(&bytes).expect("safetensors");
    file.iter()
        .map(|(name, tensor)| (name.to_string(), tensor.data().to_vec()))
        .collect()
}

/// The tensor's numbers, row by row.
pub(crate) fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.try_into_vec_as().expect("f32")
}

/// A file of `tests/cases`.
pub(crate) fn case_file(name: &str) -> PathBuf {
    PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").expect("cargo runs the tests"))
        .join("tests/cases")
        .join(name)
}

/// An empty folder, removed in the end.
pub(crate) fn tempdir() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder")
}
