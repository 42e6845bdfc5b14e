//! Trains one model of two people on films of them, and renders one from a new camera, the other in
//! the pose of the first, and a person halfway between the two.
//!
//!     cargo run -p yoto-avatar --example train_and_render -- out/example
//!
//! It takes about a minute on two cores. The people are synthetic; `CaptureFolder::open` reads other
//! captures into shards.

use burn::tensor::Device;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use yoto_avatar::config::ModelConfig;
use yoto_avatar::render::{RenderView, Rendered};
use yoto_avatar::train::{Budget, TrainOptions, TrainPerson, Trainer, Validation};
use yoto_capture::ShardBuilder;
use yoto_capture::camera::{Camera, Pose};
use yoto_synthetic::SyntheticPerson;

const SIZE: u32 = 96;
const FRAMES: usize = 40;
const STEPS: u64 = 1200;

fn main() -> Result<(), Box<dyn Error>> {
    let out = std::env::args()
        .nth(1)
        .unwrap_or_else(|| "out/example".into());
    let out = PathBuf::from(out);
    std::fs::create_dir_all(&out)?;

    let cast = SyntheticPerson::cast(2, 7);
    let mut people = Vec::new();
    for (slot, actor) in cast.iter().enumerate() {
        let (track, film) = actor.capture(FRAMES, SIZE);
        let mut shard = ShardBuilder::new(track);
        for image in &film {
            shard.push(image)?;
        }
        people.push(TrainPerson {
            slot,
            name: actor.name().into(),
            shard: Arc::new(shard.finish()?),
        });
    }

    let config = ModelConfig::named("draft", "yoto")?;
    let options = TrainOptions {
        budget: Budget::Steps(STEPS),
        validation: Validation::Every(10),
        ..TrainOptions::default()
    };
    let mut trainer = Trainer::new(config, options, people, &Device::flex())?;
    while !trainer.finished() {
        trainer.step()?;
        let progress = trainer.progress();
        if progress.step.is_multiple_of(200) {
            trainer.validate()?;
            let psnr = trainer.progress().psnr.unwrap_or(f64::NAN);
            println!(
                "step {}: {:?}, held-out frames {psnr:.2} dB, active: {}",
                progress.step,
                progress.loss_terms,
                progress.active_parts.join(", ")
            );
        }
    }

    let renderer = trainer.renderer();
    let camera = &SyntheticPerson::held_out_cameras(SIZE)[1];
    let view = |slot: usize, pose: &Pose| RenderView {
        slot,
        pose: pose.clone(),
        camera: Camera::clone(camera),
        background: [0.0; 3],
    };
    let pose = &cast[0].unseen_motion(8)[3];
    write(&out.join("first.png"), &renderer.render(&view(0, pose))?)?;
    write(&out.join("second.png"), &renderer.render(&view(1, pose))?)?;
    let (renderer, halfway) = renderer.with_blend(0, 1, 0.5)?;
    let halfway = halfway[0];
    write(
        &out.join("halfway.png"),
        &renderer.render(&view(halfway, pose))?,
    )?;
    println!("pictures in {}", out.display());
    Ok(())
}

fn write(path: &Path, frame: &Rendered) -> Result<(), Box<dyn Error>> {
    let (width, height) = (frame.width as u32, frame.height as u32);
    let picture = image::RgbImage::from_raw(width, height, frame.to_rgb8());
    Ok(picture.ok_or("a frame of another size")?.save(path)?)
}
