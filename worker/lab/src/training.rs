//! Parts shared by the experiments: the device, training with a display, the size of a checkpoint.

use crate::display::{Display, Screen};
use anyhow::{Context, ensure};
use yoto_avatar::evaluate::LpipsMetric;
use yoto_avatar::loss::lpips::LpipsWeights;
use yoto_avatar::train::{Budget, TrainOptions, TrainProgress, Trainer};
use yoto_device::PickedDevice;
use yoto_proto::v1::Progress;

/// The device, shown on the screen.
pub(crate) fn pick_device(screen: &dyn Screen) -> PickedDevice {
    let picked = yoto_device::pick();
    screen.note(&format!("computing on {}", picked.info.adapter));
    if let Some(hint) = yoto_device::hint_on_cpu() {
        screen.note(&hint);
    }
    picked
}

/// The networks of LPIPS, where there are weights.
pub(crate) fn lpips(
    weights: Option<&LpipsWeights>,
    picked: &PickedDevice,
) -> anyhow::Result<Option<LpipsMetric>> {
    weights
        .map(|weights| LpipsMetric::load(weights, &picked.device))
        .transpose()
        .context("loading the weights of LPIPS")
}

/// Options under which all frames train: held-out views and poses stand beside them.
pub(crate) fn options(
    budget: Budget,
    image_size: u32,
    seed: u64,
    lpips: Option<&LpipsWeights>,
) -> TrainOptions {
    TrainOptions {
        budget,
        image_size,
        seed,
        lpips: lpips.cloned(),
        ..TrainOptions::default()
    }
}

/// Trains until the budget is used up. After each step, `after_step` may measure the model, and
/// returns the newest held-out PSNR for the display.
pub(crate) fn train(
    trainer: &mut Trainer,
    display: &mut dyn Display,
    mut after_step: impl FnMut(&Trainer, &mut dyn Display) -> anyhow::Result<Option<f64>>,
) -> anyhow::Result<()> {
    let mut psnr = None;
    while !trainer.finished() {
        trainer.step().context("a training step")?;
        display.progress(&shown(&trainer.progress(), "training", psnr));
        psnr = after_step(trainer, display)?;
    }
    Ok(())
}

/// Trains until the budget is used up, without measurements on the way.
pub(crate) fn train_to_the_end(
    trainer: &mut Trainer,
    display: &mut dyn Display,
) -> anyhow::Result<()> {
    train(trainer, display, |_, _| Ok(None))
}

/// The trainer's progress in the terms of the display.
pub(crate) fn shown(progress: &TrainProgress, phase: &str, psnr: Option<f64>) -> Progress {
    Progress {
        phase: phase.to_owned(),
        step: progress.step,
        fraction: progress.fraction,
        steps_per_second: progress.steps_per_second,
        loss: Some(progress.loss),
        psnr,
        seconds_left: Some(progress.seconds_left),
        skipped_steps: progress.skipped_steps,
        ..Progress::default()
    }
}

/// Size of a checkpoint of this training on disk, bytes, by writing one.
pub(crate) fn checkpoint_bytes(trainer: &Trainer) -> anyhow::Result<u64> {
    let folder = tempfile::tempdir().context("making a temporary folder")?;
    trainer.save(folder.path()).context("saving a checkpoint")?;
    let mut bytes = 0;
    for entry in std::fs::read_dir(folder.path()).context("reading the checkpoint's folder")? {
        bytes += entry
            .and_then(|entry| entry.metadata())
            .context("measuring the checkpoint")?
            .len();
    }
    ensure!(bytes > 0, "the checkpoint is empty");
    Ok(bytes)
}
