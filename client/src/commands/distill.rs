//! `yoto distill`: splats that show what a field has learned about one person.

use super::person_args::{ChosenPerson, PersonArgs};
use crate::capture_dir::{CaptureOptions, DecodedCapture};
use crate::output;
use crate::progress::{ProgressDisplay, count};
use crate::studio::clips::{Source, read_track};
use anyhow::{Context, ensure};
use clap::Args;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};
use yoto_avatar::config::ModelConfig;
use yoto_avatar::distill::{Filmed, Lessons};
use yoto_avatar::render::Renderer;
use yoto_avatar::train::{Budget, Person, TrainOptions, Trainer, Validation};
use yoto_capture::Shard;
use yoto_capture::camera::Camera;
use yoto_proto::pose_track::PoseTrack;
use yoto_proto::v1::Progress;

const AFTER_HELP: &str = "\
Renders the person all around in poses of the capture for a third of the time, and trains splats on these
pictures for the rest; with --frames, on those of the capture as well. The new model has the person in slot 0, and plays, exports and renders as any model
of splats; `yoto evaluate --model-dir DIR` compares it with what was filmed. Training splats on the capture
itself (--tier splat) shows more.

Examples:
  yoto distill fog --subject ada --capture captures/ada --out models/ada
  yoto export models/ada --capture captures/ada --out ada.html
  yoto distill fog --subject ada --capture captures/ada --frames --out models/ada
  yoto distill checkpoints/000000002000 --slot 1 --capture captures/bob --out models/bob";

/// The share of the time in which the field is rendered.
const RENDERING: f64 = 1.0 / 3.0;
/// Every so many pictures, one is held out, for the comparison at the end.
const HELD_OUT: usize = 10;
/// Fewest pictures, whatever the time.
const FEWEST: usize = 12;

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if (1.0..=86_400.0).contains(&seconds) => Ok(seconds),
        _ => Err("a number of seconds from 1 to 86400".into()),
    }
}

/// Turn one person of a model of fields into splats, which viewers and browsers play.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(super) struct Distill {
    #[command(flatten)]
    person: PersonArgs,
    /// Folder of a capture in whose poses the person is rendered.
    #[arg(long, value_name = "DIR")]
    capture: PathBuf,
    /// Trains on the capture's own frames too.
    #[arg(long)]
    frames: bool,
    /// Longest side of the pictures, pixels. They are square, or have the form of the capture's frames.
    #[arg(long, default_value_t = 256, value_name = "PX", value_parser = clap::value_parser!(u32).range(64..=2048))]
    size: u32,
    /// Seconds of rendering and training together.
    #[arg(long, default_value_t = 60.0, value_name = "S", value_parser = seconds)]
    seconds: f64,
    /// Seed of the training.
    #[arg(long, default_value_t = 7, value_name = "N")]
    seed: u64,
    /// Folder for the new model; it must not be there yet.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

impl Distill {
    pub(super) async fn run(self) -> anyhow::Result<()> {
        ensure!(
            !self.out.exists(),
            "{} is there already: choose another folder (--out)",
            self.out.display()
        );
        let track = read_track(&self.capture)?;
        let chosen = self.person.fetch().await?;
        tokio::task::block_in_place(|| match self.frames {
            true => {
                let options = CaptureOptions::default();
                let decoded = DecodedCapture::open(&self.capture, &options, None)?;
                let shard = decoded.shard(|_| {})?;
                self.distill(&chosen, &shard.track, self.filmed(&shard)?)
            }
            false => self.distill(&chosen, &track, Vec::new()),
        })
    }

    /// The frames of the capture, at most as large as the film.
    fn filmed(&self, shard: &Shard) -> anyhow::Result<Vec<Filmed>> {
        let frames = shard.track.frames.iter().enumerate();
        let filmed = frames.map(|(place, frame)| {
            let camera = Camera::from_frame(frame, shard.track.image_size)
                .with_context(|| format!("{}: frame {}", self.capture.display(), frame.index))?;
            Ok(Filmed {
                camera: camera.scaled_to(self.size),
                image: shard.image(place).resized(self.size),
            })
        });
        filmed.collect()
    }

    /// Films the person and trains splats on the film, with what was `filmed` before of the track's poses.
    fn distill(
        &self,
        chosen: &ChosenPerson,
        track: &PoseTrack,
        filmed: Vec<Filmed>,
    ) -> anyhow::Result<()> {
        let slot = chosen.slot;
        let model = || format!("the model {}", chosen.model);
        let device = yoto_device::pick().device;
        let renderer = Renderer::load(chosen.folder(), &device).with_context(model)?;
        let tier = &renderer.config().tier;
        ensure!(
            renderer.skinned_splats(slot).with_context(model)?.is_none(),
            "{}: its tier, {tier}, has splats already: `yoto export` takes it",
            model()
        );
        let body = renderer.skeleton(slot);
        let body = body.with_context(|| format!("{} has no slot {slot}", model()))?;
        let motion = Source::track(&self.capture, track)?.on(body)?;
        let first = track.frames.first().context("the capture has no frames")?;
        let camera = Camera::from_frame(first, track.image_size)
            .with_context(|| self.capture.display().to_string())?;

        let began = Instant::now();
        let mut display = ProgressDisplay::new(format!("{} of {}", chosen.name, model()));
        let lessons = Lessons {
            renderer: &renderer,
            slot,
            poses: &motion.poses,
            up: camera.world_up(),
            size: match filmed.first() {
                Some(first) => [first.camera.width, first.camera.height],
                None => [self.size; 2],
            },
            filmed: &filmed,
        };
        let limit = Duration::from_secs_f64(RENDERING * self.seconds);
        let film = lessons.film(|pictures| {
            let passed = began.elapsed();
            display.progress(&Progress {
                phase: format!("{} rendered", count(pictures, "picture")),
                fraction: passed.as_secs_f64() / self.seconds,
                ..Progress::default()
            });
            pictures < FEWEST || passed < limit
        })?;
        let pictures = film.frames();
        let rendering = began.elapsed().as_secs_f64();
        let options = TrainOptions {
            budget: Budget::Seconds((self.seconds - rendering).max(1.0)),
            seed: self.seed,
            image_size: self.size,
            validation: Validation::Every(HELD_OUT),
            ..TrainOptions::default()
        };
        let person = Person {
            slot: 0,
            name: motion.name.clone(),
            shard: Arc::new(film),
        };
        let config = ModelConfig::named("splat", "yoto")?;
        let mut trainer = Trainer::new(config, options, vec![person], &device)?;
        while !trainer.finished() {
            trainer.step().context("a training step")?;
            let progress = trainer.progress();
            display.progress(&Progress {
                phase: "training".into(),
                step: progress.step,
                fraction: began.elapsed().as_secs_f64() / self.seconds,
                steps_per_second: progress.steps_per_second,
                loss: progress.loss,
                seconds_left: progress.seconds_left,
                ..Progress::default()
            });
        }
        trainer
            .validate()
            .context("the comparison with the field")?;
        std::fs::create_dir_all(&self.out)
            .with_context(|| format!("making {}", self.out.display()))?;
        trainer.save(&self.out).context("writing the new model")?;
        let progress = trainer.progress();
        let splats = trainer.renderer().skinned_splats(0)?;
        let splats = splats.map_or(0, |person| person.splats.len());
        display.finish(&format!(
            "{splats} splats from {}, {:.0} s",
            count(pictures, "picture"),
            began.elapsed().as_secs_f64()
        ));
        if let (Some(whole), Some(near)) = (progress.psnr, progress.psnr_mask_box) {
            say!(
                "{whole:.2} dB to {} on pictures that were held out, {near:.2} dB near the person",
                if self.frames {
                    "the field and the capture"
                } else {
                    "the field"
                }
            );
            output::put("psnr", whole);
            output::put("psnr_mask_box", near);
        }
        say!("{}", self.out.display());
        output::put("splats", splats);
        output::put("pictures", pictures);
        Ok(())
    }
}
