//! `yoto demo`: the whole service in one command.

use crate::demo::{DemoOptions, run};
use crate::{args, show};
use clap::Args;
use std::path::PathBuf;
use yoto_avatar::loss::lpips::LpipsWeights;
use yoto_terminal::output;

const AFTER_HELP: &str = "\
Steps, as a client of a service in its own process:
  1. generates people, records each with one camera, and uploads the captures;
  2. trains one shared model on all of them;
  3. renders each from held-out cameras and in held-out poses, an orbit around each, and
     the first person's motion on the second person's body;
  4. compares the renders with the truth;
  5. writes a page per person, which plays them in a browser (ada.html and so on): turn,
     zoom, bend, take another's motion.

index.html shows everything; --open opens it. contact-sheet.png has all renders; *-animation.png
files play in a browser.

Examples:
  yoto demo --open
  yoto demo --subjects 2 --seconds 60 --out out/quick";

/// Generate people, train one model of them, render them: all of yoto in minutes.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Demo {
    /// Folder for the demo's output.
    #[arg(long, value_name = "DIR", default_value = "out/demo")]
    out: PathBuf,
    /// Number of people in the model.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=16))]
    subjects: u32,
    /// Side of the pictures, pixels.
    #[arg(long, value_name = "PX", default_value_t = 256, value_parser = clap::value_parser!(u32).range(16..=1024))]
    size: u32,
    /// Seconds of training.
    #[arg(long, value_name = "S", default_value = "150", value_parser = args::seconds)]
    seconds: f64,
    /// Random seed.
    #[arg(long, default_value_t = 7)]
    seed: u64,
    /// Open the page in a browser at the end.
    #[arg(long)]
    open: bool,
    #[command(flatten)]
    lpips: yoto_terminal::args::LpipsArgs,
}

impl Demo {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let options = DemoOptions {
            out: self.out,
            subjects: self.subjects as usize,
            size: self.size,
            seconds: self.seconds,
            seed: self.seed,
            lpips: self.lpips.weights(LpipsWeights::both)?,
        };
        let report = run(&options).await?;
        output::put("report", serde_json::to_value(&report)?);
        say!("\n{}", report.table());
        say!("\nLook at:");
        for (file, what) in crate::demo::products(&options) {
            say!("  {:<44} {what}", file.display());
        }
        if self.open {
            show::in_browser(crate::demo::index(&options));
        }
        Ok(())
    }
}
