//! Whether a picture of one person costs more in a model of many people than in one of few:
//!
//! ```text
//! cargo run -p yoto-worker --example actors -- TIER FEW MANY SIZE [PICTURES]
//! ```
//!
//! Trains a model of FEW made-up people and one of MANY, 30 steps per person, and draws the first person of each
//! in the rest pose while the camera goes around, one picture of each model in turn. Prints milliseconds of a
//! picture, and the number of samples at which a field was evaluated: that of two trainings differs.

use std::sync::Arc;
use std::time::Instant;
use yoto_avatar::config::ModelConfig;
use yoto_avatar::render::{RenderView, Renderer};
use yoto_avatar::train::{Budget, Person, TrainOptions, Trainer, Validation};
use yoto_capture::ShardBuilder;
use yoto_capture::camera::{Camera, Pose};
use yoto_synthetic::SyntheticPerson;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// Steps of training per person.
const STEPS: u64 = 30;
/// Side of the training frames, pixels, and how many there are of each person.
const FILM: (u32, usize) = (96, 12);

fn main() -> Outcome<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (tier, few, many, size, pictures) = match arguments.as_slice() {
        [tier, few, many, size] => (tier, few, many, size, "30"),
        [tier, few, many, size, pictures] => (tier, few, many, size, pictures.as_str()),
        _ => return Err("TIER FEW MANY SIZE are needed".into()),
    };
    let (counts, size, pictures): ([usize; 2], u32, usize) = (
        [few.parse()?, many.parse()?],
        size.parse()?,
        pictures.parse()?,
    );
    let models = counts.map(|count| trained(tier, count));
    let [few, many] = models;
    let models = [few?, many?];
    let mut times = [Vec::new(), Vec::new()];
    let mut samples = [0, 0];
    for picture in 0..pictures {
        for (at, model) in models.iter().enumerate() {
            let view = view(model, picture as f64 / pictures as f64, size)?;
            let began = Instant::now();
            let drawn = model.render(&view)?;
            times[at].push(1e3 * began.elapsed().as_secs_f64());
            samples[at] += drawn.counts.evaluated;
        }
    }
    for ((count, times), samples) in counts.iter().zip(&mut times).zip(samples) {
        times.sort_by(f64::total_cmp);
        println!(
            "{count} people: {:.1} ms per picture (median), {:.1} ms (least), {:.0} thousand samples per picture",
            times[times.len() / 2],
            times[0],
            1e-3 * samples as f64 / pictures as f64
        );
    }
    Ok(())
}

/// A model of `count` people.
fn trained(tier: &str, count: usize) -> Outcome<Renderer> {
    let (side, frames) = FILM;
    let cast = SyntheticPerson::cast(count, 7);
    let people = cast.iter().enumerate().map(|(slot, person)| {
        let (track, images) = person.capture(frames, side);
        let mut shard = ShardBuilder::new(track);
        for image in &images {
            shard.push(image)?;
        }
        Ok(Person {
            slot,
            name: format!("{slot}"),
            shard: Arc::new(shard.finish()?),
        })
    });
    let people = people.collect::<Outcome<Vec<_>>>()?;
    let options = TrainOptions {
        budget: Budget::Steps(STEPS * count as u64),
        validation: Validation::NONE,
        ..TrainOptions::default()
    };
    let config = ModelConfig::named(tier, "yoto")?;
    let mut trainer = Trainer::new(config, options, people, &yoto_device::pick().device)?;
    while !trainer.finished() {
        trainer.step()?;
    }
    Ok(trainer.renderer())
}

/// The first person, seen from a share of the way `around` them.
fn view(model: &Renderer, around: f64, size: u32) -> Outcome<RenderView> {
    let skeleton = model.skeleton(0).ok_or("nobody is in slot 0")?;
    let [x, y, z] = skeleton.root();
    let around = std::f64::consts::TAU * around;
    let eye = [x + 3.0 * around.sin(), y, z + 3.0 * around.cos()];
    let focal = 1.4 * f64::from(size);
    Ok(RenderView {
        slot: 0,
        pose: Pose::rest(skeleton.joints()),
        camera: Camera::look_at(eye, [x, y, z], [0.0, 1.0, 0.0], focal, size, size),
        background: [0.0; 3],
    })
}
