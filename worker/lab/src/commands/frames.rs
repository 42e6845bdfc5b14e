//! `yoto-lab frames`: how fast a model draws one person, and where the time of a picture goes.

use anyhow::Context;
use clap::Args;
use std::f64::consts::TAU;
use std::path::PathBuf;
use std::time::Instant;
use yoto_avatar::render::{RenderView, Renderer};
use yoto_capture::camera::{Camera, Pose};
use yoto_media::png::{self, Pixels};
use yoto_terminal::output;

const AFTER_HELP: &str = "\
The model is a folder as `yoto model export` writes it. The person stands in the rest pose, and the
camera goes around them. Prints the median milliseconds per picture: drawing, rounding to 8 bits, PNG.

Example:
  yoto-lab frames models/duo --slot 1 --size 512";

/// Time the pictures of one person.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(super) struct Frames {
    /// Folder of the model.
    #[arg(value_name = "DIR")]
    model: PathBuf,
    /// Identity slot in the model.
    #[arg(long, default_value_t = 0)]
    slot: usize,
    /// Side of the pictures, pixels.
    #[arg(long, value_name = "PX", default_value_t = 512, value_parser = clap::value_parser!(u32).range(1..=8192))]
    size: u32,
    /// Number of pictures.
    #[arg(long, value_name = "N", default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..))]
    pictures: u32,
}

impl Frames {
    pub(super) fn run(self) -> anyhow::Result<()> {
        let Self { slot, size, .. } = self;
        let renderer = Renderer::load(&self.model, &yoto_device::pick().device)
            .with_context(|| format!("the model {}", self.model.display()))?;
        let skeleton = renderer
            .skeleton(slot)
            .ok_or_else(|| renderer.absence(slot))?;
        let [x, y, z] = skeleton.root();
        let mut times = [Vec::new(), Vec::new(), Vec::new()];
        let mut bytes = 0;
        for number in 0..self.pictures {
            let angle = TAU * f64::from(number) / f64::from(self.pictures);
            let eye = [x + 3.0 * angle.sin(), y, z + 3.0 * angle.cos()];
            let focal = 1.4 * f64::from(size);
            let view = RenderView {
                slot,
                pose: Pose::rest(skeleton.joints()),
                camera: Camera::look_at(eye, [x, y, z], [0.0, 1.0, 0.0], focal, size, size),
                background: [0.0; 3],
            };
            let start = Instant::now();
            let drawn = renderer.render(&view)?;
            let rendered = Instant::now();
            let rounded = drawn.to_rgb8();
            let whole = Instant::now();
            bytes = png::encode(Pixels::Rgb, size, size, &rounded)?.len();
            let spans = [
                (start, rendered),
                (rendered, whole),
                (whole, Instant::now()),
            ];
            for (times, (start, end)) in times.iter_mut().zip(spans) {
                times.push(1e3 * (end - start).as_secs_f64());
            }
        }
        let [draw, round, encode] = times.map(|mut times| {
            times.sort_by(f64::total_cmp);
            times[times.len() / 2]
        });
        say!(
            "drawing {draw:.1} ms, rounding {round:.1} ms, PNG {encode:.1} ms ({bytes} bytes): {:.0} pictures \
             per second, {:.0} without PNG",
            1e3 / (draw + round + encode),
            1e3 / (draw + round)
        );
        output::put(
            "milliseconds",
            serde_json::json!({ "draw": draw, "round": round, "png": encode }),
        );
        Ok(())
    }
}
