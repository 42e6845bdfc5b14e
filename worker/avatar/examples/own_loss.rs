//! Trains with a custom objective: absolute differences in place of squared ones.
//!
//!     cargo run -p yoto-avatar --example own_loss
//!
//! It takes about half a minute on two cores.

use burn::tensor::Device;
use std::error::Error;
use std::sync::Arc;
use yoto_avatar::config::ModelConfig;
use yoto_avatar::loss::{LossTerm, Objective, Patches};
use yoto_avatar::train::{Budget, TrainOptions, TrainPerson, Trainer, Validation};
use yoto_capture::ShardBuilder;
use yoto_synthetic::SyntheticPerson;

/// Mean absolute error, and the error of the mean colour of a patch.
struct Absolute;

impl Objective for Absolute {
    fn name(&self) -> &'static str {
        "absolute+mean colour"
    }

    fn terms(&self, patches: Patches) -> Vec<LossTerm> {
        let difference = patches.predicted - patches.truth;
        let colour = difference.clone().mean_dim(1);
        vec![
            LossTerm {
                name: "absolute",
                weight: 1.0,
                value: difference.abs().mean(),
            },
            LossTerm {
                name: "mean colour",
                weight: 0.1,
                value: colour.abs().mean(),
            },
        ]
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let actor = &SyntheticPerson::cast(1, 7)[0];
    let (track, film) = actor.capture(30, 96);
    let mut shard = ShardBuilder::new(track);
    for image in &film {
        shard.push(image)?;
    }
    let person = TrainPerson {
        slot: 0,
        name: actor.name().into(),
        shard: Arc::new(shard.finish()?),
    };
    let mut config = ModelConfig::named("draft", "yoto")?;
    // The schedule is data, too: here, non-rigid motion starts in the middle of the run.
    config.schedule.non_rigid = 0.5;
    config.schedule.all_bands = 0.8;
    let options = TrainOptions {
        budget: Budget::Steps(600),
        validation: Validation::Every(10),
        ..TrainOptions::default()
    };
    let mut trainer = Trainer::new(config, options, vec![person], &Device::flex())?
        .with_objective(Box::new(Absolute))?;
    while !trainer.finished() {
        trainer.step()?;
        if trainer.progress().step.is_multiple_of(200) {
            trainer.validate()?;
            let progress = trainer.progress();
            println!(
                "step {}: {} {:?}, held-out frames {:.2} dB",
                progress.step,
                progress.objective,
                progress.loss_terms,
                progress.psnr.unwrap_or(f64::NAN)
            );
        }
    }
    Ok(())
}
