//! `yoto-lab distill`: splats that show what a field has learned about one person.

use anyhow::{Context, ensure};
use clap::Args;
use clap::builder::RangedU64ValueParser;
use std::path::PathBuf;
use yoto_avatar::distill::{CaptureFrame, DistillStage, Distilled, StudentTraining, Teacher};
use yoto_avatar::render::Renderer;
use yoto_avatar::train::refined_track;
use yoto_capture::Shard;
use yoto_capture::skeleton::Skeleton;
use yoto_export::source::Source;
use yoto_import::capture_dir::{CaptureOptions, DecodedCapture, named, read_track};
use yoto_proto::checks::export;
use yoto_proto::exports;
use yoto_proto::pose_track::PoseTrack;
use yoto_proto::v1::Progress;
use yoto_terminal::output;
use yoto_terminal::progress::{ProgressDisplay, count};

const AFTER_HELP: &str = "\
Renders the person all around in poses of the capture for a third of the time, and trains splats on these
pictures for the rest; with --frames, on those of the capture as well, which has what the field lost. The new model has
the person in slot 0: `yoto export` takes it, `yoto-lab render-frame` draws single pictures, and `yoto-lab
evaluate` compares it with what was filmed. For films and scenes, train splats on the captures themselves
(`yoto train --tier splat`), which also shows more. The service's `yoto export MODEL` does all of this by
itself; `yoto model export MODEL` writes a model of the service to a folder.

Examples:
  yoto model export fog --out models/fog
  yoto-lab distill models/fog --capture captures/ada --out models/ada
  yoto export models/ada --capture captures/ada --out ada.html
  yoto-lab distill models/fog --capture captures/ada --frames --out models/ada
  yoto-lab distill checkpoints/000000002000 --slot 1 --capture captures/bob --out models/bob";

/// Turn one person of a model of fields into splats, which viewers and browsers play.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(super) struct Distill {
    /// Folder of a model of fields.
    #[arg(value_name = "DIR")]
    model: PathBuf,
    /// Identity slot of the person.
    #[arg(long, value_name = "N", default_value_t = 0)]
    slot: usize,
    /// Folder of a capture in whose poses the person is rendered.
    #[arg(long, value_name = "DIR")]
    capture: PathBuf,
    /// Trains on the capture's own frames too.
    #[arg(long)]
    frames: bool,
    /// Shorter side of the pictures, pixels. They are square; with --frames they have the form of the capture's
    /// frames, and at most their size.
    #[arg(long, default_value_t = exports::SIZE, value_name = "PX", value_parser = sizes())]
    size: u32,
    /// Seconds of rendering and training together; with a slow field, more: at least 12 pictures are rendered, and
    /// the training has two thirds of this.
    #[arg(long, default_value_t = exports::SECONDS, value_name = "S", value_parser = seconds)]
    seconds: f64,
    /// Seed of the training.
    #[arg(long, default_value_t = 7, value_name = "N")]
    seed: u64,
    /// Folder for the new model; it must not be there yet.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

impl Distill {
    pub(super) fn run(self) -> anyhow::Result<()> {
        ensure!(
            !self.out.exists(),
            "{} is there already: choose another folder (--out)",
            self.out.display()
        );
        let track = read_track(&self.capture)?;
        if !self.frames {
            return self.distill(&track, None);
        }
        let decoded = DecodedCapture::open(&self.capture, &CaptureOptions::default(), None)?;
        let shard = decoded.shard(|_| {})?;
        self.distill(&shard.track, Some(&shard))
    }

    /// Renders the person in the poses of `track`, and trains splats on the pictures and on the frames of
    /// `capture`.
    fn distill(&self, track: &PoseTrack, capture: Option<&Shard>) -> anyhow::Result<()> {
        let slot = self.slot;
        let model = || format!("the model {}", self.model.display());
        let device = yoto_device::pick().device;
        let renderer = Renderer::load(&self.model, &device).with_context(model)?;
        let tier = &renderer.config().tier;
        ensure!(
            renderer.skinned_splats(slot).with_context(model)?.is_none(),
            "{}: its tier, {tier}, has splats already: `yoto export` takes it",
            model()
        );
        let body = renderer.skeleton(slot);
        let body = body.with_context(|| format!("{} has no slot {slot}", model()))?;
        let refined = refined_track(&self.model, slot, track).with_context(model)?;
        let name = named(&self.capture);
        let source = Source::track(&name, refined.as_ref().unwrap_or(track))?;
        let poses = source.poses(body)?;
        let same = Skeleton::from_track(&track.skeleton)? == *body;
        ensure!(
            capture.is_none() || same,
            "--frames: {} is of another body than slot {slot} of {}: its poses alone are of use",
            self.capture.display(),
            model()
        );
        let capture_frames = match capture {
            Some(capture) => CaptureFrame::of(capture, &poses, self.size)
                .with_context(|| self.capture.display().to_string())?,
            None => Vec::new(),
        };
        let teacher = Teacher {
            renderer: &renderer,
            slot,
            poses: &poses,
            up: source.up(),
            size: CaptureFrame::size(&capture_frames).unwrap_or([self.size; 2]),
            capture_frames: &capture_frames,
        };
        let training = StudentTraining {
            name,
            seconds: self.seconds,
            seed: self.seed,
            scratch: None,
        };
        let mut display = ProgressDisplay::new(format!("slot {slot} of {}", model()));
        let tell =
            &mut |stage: DistillStage, fraction: f64| display.progress(&shown(stage, fraction));
        let Distilled {
            trainer,
            pictures,
            time,
        } = training.run(&teacher, &device, tell, &mut || true)?;
        std::fs::create_dir_all(&self.out)
            .with_context(|| format!("making {}", self.out.display()))?;
        trainer.save(&self.out).context("writing the new model")?;
        let progress = trainer.progress();
        let splats = trainer.renderer().skinned_splats(0)?;
        let splats = splats.map_or(0, |person| person.splats.len());
        display.finish(&format!(
            "{splats} splats from {}, {:.0} s",
            count(pictures, "picture"),
            time.as_secs_f64()
        ));
        if let (Some(whole), Some(near)) = (progress.psnr, progress.psnr_mask_box) {
            say!(
                "{whole:.2} dB to the field on pictures that were held out, {near:.2} dB near the person"
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

/// The progress of a `stage`; `fraction` is the share of the whole distillation that is done.
fn shown(stage: DistillStage, fraction: f64) -> Progress {
    match stage {
        DistillStage::Rendering(pictures) => Progress {
            phase: format!("{} rendered", count(pictures, "picture")),
            fraction,
            ..Progress::default()
        },
        DistillStage::Training(now) => Progress {
            phase: "training".into(),
            step: now.step,
            fraction,
            steps_per_second: now.steps_per_second,
            loss: Some(now.loss),
            seconds_left: Some(now.seconds_left),
            ..Progress::default()
        },
    }
}

/// Parses the length of a distillation, seconds.
fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if export::SECONDS.contains(&seconds) => Ok(seconds),
        _ => {
            let (least, most) = (export::SECONDS.start(), export::SECONDS.end());
            Err(format!("a number of seconds from {least} to {most}"))
        }
    }
}

/// A parser of the side of a distillation's pictures, pixels.
fn sizes() -> RangedU64ValueParser<u32> {
    let (least, most) = (*export::SIZES.start(), *export::SIZES.end());
    RangedU64ValueParser::new().range(u64::from(least)..=u64::from(most))
}
