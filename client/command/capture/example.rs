//! `yoto capture example`: captures for a first try.

use clap::Args;
use std::path::PathBuf;
use yoto_import::{ensure_no_capture, write_images};
use yoto_synthetic::SyntheticPerson;
use yoto_terminal::output;
use yoto_terminal::progress::ProgressDisplay;

pub(crate) const AFTER_HELP: &str = "\
Each folder holds poses.json, frames/ and masks/, as a capture of a real person does.

Examples:
  yoto capture example --out captures
  yoto capture example --people 4 --frames 100 --size 256 --out captures";

#[derive(Debug, Args)]
pub(crate) struct Example {
    /// Number of people.
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u8).range(1..=100))]
    people: u8,
    /// Frames of each person.
    #[arg(long, value_name = "N", default_value_t = 60, value_parser = clap::value_parser!(u32).range(2..=10_000))]
    frames: u32,
    /// Side of the frames, pixels.
    #[arg(long, value_name = "PX", default_value_t = 128, value_parser = clap::value_parser!(u32).range(16..=2048))]
    size: u32,
    /// Random seed.
    #[arg(long, default_value_t = 7)]
    seed: u64,
    /// Folder that gets one folder per person.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

impl Example {
    pub(crate) fn run(self) -> anyhow::Result<()> {
        let cast = SyntheticPerson::cast(self.people.into(), self.seed);
        for person in &cast {
            ensure_no_capture(&self.out.join(person.name()))?;
        }
        let mut display = ProgressDisplay::new("example");
        let mut folders = Vec::new();
        for (done, person) in cast.iter().enumerate() {
            display.count("person", done, cast.len());
            let (track, images) = person.capture(self.frames as usize, self.size);
            let folder = self.out.join(person.name());
            write_images(&track, &images, &folder)?;
            folders.push(folder);
        }
        display.clear();
        for folder in &folders {
            say!("{}", folder.display());
        }
        output::put("files", output::paths(&folders));
        Ok(())
    }
}
