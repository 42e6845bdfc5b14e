//! `yoto-lab render-frame`: one frame of a model's folder, without a service, in full precision.

use crate::npz::{self, Array};
use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};
use yoto_avatar::config::Numerics;
use yoto_avatar::render::{RenderSettings, RenderView, Rendered, Renderer};
use yoto_capture::CaptureView;
use yoto_media::picture_file;
use yoto_terminal::output;

const AFTER_HELP: &str = "\
A model is a folder with weights.safetensors and state.json: a checkpoint, or what
`yoto-lab import-humannerf` writes. Of the capture only poses.json is read. The
background is black.

An .npz holds rgb [H, W, 3], alpha [H, W] and depth [H, W] as f32: depth is the sum of
weight times camera z, metres, not divided by alpha. A .png holds the colours.

Examples:
  yoto-lab render-frame --model-dir imported --capture data/ada --camera train --frame 30 --out f.npz
  yoto-lab render-frame --model-dir ckpt --capture data/ada --camera cam00 --frame 5 --size 256 --out f.png";

/// Render one frame of a capture with a model on this disk.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(super) struct RenderFrame {
    /// Folder of the model.
    #[arg(long = "model-dir", alias = "model", value_name = "DIR")]
    model: PathBuf,
    /// Folder of the capture with pose and camera.
    #[arg(long, value_name = "DIR")]
    capture: PathBuf,
    /// Camera: `train`, or one of the capture's held-out cameras.
    #[arg(long, value_name = "CAM")]
    camera: String,
    /// Number of the frame, training or held out.
    #[arg(long, value_name = "N")]
    frame: u32,
    /// Identity slot in the model.
    #[arg(long, default_value_t = 0)]
    slot: usize,
    /// Numerics of the render [default: the model's].
    #[arg(long, value_enum)]
    numerics: Option<NumericsName>,
    /// Render with the parts that are active at this iteration of the model's training schedule,
    /// instead of its own iteration; all parts of an imported model are active.
    #[arg(long, value_name = "N")]
    iteration: Option<u64>,
    /// Samples per ray [default: the model's].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=4096))]
    samples: Option<u32>,
    /// Longest side of the picture, pixels [default: the capture's].
    #[arg(long, value_name = "PX", value_parser = clap::value_parser!(u32).range(1..=8192))]
    size: Option<u32>,
    /// File for the frame: .npz or .png.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum NumericsName {
    /// Bounded at all extremes.
    Sound,
    /// As in the released HumanNeRF program.
    Reference,
}

impl RenderFrame {
    pub(super) fn run(self) -> anyhow::Result<()> {
        let write = writer(&self.out)?;
        let view = CaptureView::read(&self.capture, &self.camera, self.frame)
            .with_context(|| format!("the capture {}", self.capture.display()))?;
        let picked = yoto_device::pick();
        let mut renderer = Renderer::load(&self.model, &picked.device)
            .with_context(|| format!("the model {}", self.model.display()))?;
        if let Some(numerics) = self.numerics {
            renderer = renderer.with_numerics(match numerics {
                NumericsName::Sound => Numerics::Sound,
                NumericsName::Reference => Numerics::Reference,
            });
        }
        if let Some(iteration) = self.iteration {
            renderer = renderer.at_iteration(iteration);
        }
        if let Some(samples) = self.samples {
            let settings = RenderSettings {
                samples: samples as usize,
                ..renderer.settings()
            };
            renderer = renderer.with_settings(&settings)?;
        }
        let skeleton = renderer
            .skeleton(self.slot)
            .ok_or_else(|| renderer.absence(self.slot))?;
        let frame = renderer.render(&RenderView {
            slot: self.slot,
            pose: view.pose_for(skeleton),
            camera: view.camera.scaled_to(self.size.unwrap_or(0)),
            background: [0.0; 3],
        })?;
        write(&self.out, &frame)?;
        say!("{}", self.out.display());
        output::put("files", output::paths(&[&self.out]));
        Ok(())
    }
}

type Writer = fn(&Path, &Rendered) -> anyhow::Result<()>;

/// The writer of files with this extension; an unknown one fails before anything is computed.
fn writer(path: &Path) -> anyhow::Result<Writer> {
    match path.extension().and_then(|extension| extension.to_str()) {
        Some("npz") => Ok(write_npz),
        Some("png") => Ok(write_png),
        _ => bail!("--out {}: neither .npz nor .png", path.display()),
    }
}

fn write_npz(path: &Path, frame: &Rendered) -> anyhow::Result<()> {
    let (height, width) = (frame.height, frame.width);
    let array = |name, shape, values| Array {
        name,
        shape,
        values,
    };
    npz::write(
        path,
        &[
            array("rgb", &[height, width, 3], &frame.rgb),
            array("alpha", &[height, width], &frame.alpha),
            array("depth", &[height, width], &frame.depth),
        ],
    )
}

fn write_png(path: &Path, frame: &Rendered) -> anyhow::Result<()> {
    let picture = picture_file::rgb("the frame", frame.width, frame.height, &frame.to_rgb8())?;
    Ok(picture_file::write(path, &picture)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Cli {
        #[command(flatten)]
        frame: RenderFrame,
    }

    #[test]
    fn samples_are_the_model_s_unless_given() {
        let samples = |more: &str| {
            let line = format!(
                "yoto --model-dir m --capture c --camera train --frame 1 --out f.png{more}"
            );
            let parsed = Cli::try_parse_from(line.split(' '));
            parsed.map(|cli| cli.frame.samples).ok()
        };
        assert_eq!(samples(""), Some(None));
        assert_eq!(samples(" --samples 256"), Some(Some(256)));
        assert_eq!(samples(" --samples 5000"), None);
    }
}
