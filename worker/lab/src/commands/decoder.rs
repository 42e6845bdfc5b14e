//! `yoto-lab decoder`: what people look like, learned from a model of many.

use anyhow::{Context, ensure};
use clap::Args;
use std::path::PathBuf;
use yoto_avatar::decoder::Decoder;
use yoto_avatar::decoder::learn::ExamplePerson;
use yoto_avatar::field::splats::opaque_area;
use yoto_avatar::render::Renderer;
use yoto_terminal::output;

const AFTER_HELP: &str = "\
The people of the model must have SMPL's joints and be filmed from every side. The file says what it was learned from
(--note), and takes the place of the program's own with --init of `yoto-lab quality`.

Examples:
  yoto-lab quality --capture people/* --size 256 --steps 14400 --refine-poses=never --out report.json --save models/people
  yoto-lab decoder models/people --note 'licence=MIT' --out people.safetensors
  yoto-lab quality --capture captures/front --init people.safetensors --out report.json";

/// Learn the decoder of what people look like from a model of many people.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(super) struct DecoderCommand {
    /// Folder of a model of splats.
    #[arg(value_name = "DIR")]
    model: PathBuf,
    /// Numbers of a code, at most as many as there are people.
    #[arg(long, default_value_t = 24, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    rank: u16,
    /// A fact for the file, such as its licence; may be repeated.
    #[arg(long = "note", value_name = "NAME=TEXT", value_parser = note)]
    notes: Vec<(String, String)>,
    /// The decoder's file.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

pub(super) fn note(text: &str) -> Result<(String, String), String> {
    let (name, value) = text.split_once('=').ok_or("a name, =, and a text")?;
    Ok((name.to_owned(), value.to_owned()))
}

impl DecoderCommand {
    pub(super) fn run(self) -> anyhow::Result<()> {
        let model = || format!("the model {}", self.model.display());
        let device = yoto_device::pick().device;
        let renderer = Renderer::load(&self.model, &device).with_context(model)?;
        let mut people = Vec::new();
        for slot in (0..).take_while(|slot| renderer.skeleton(*slot).is_some()) {
            let splats = renderer.skinned_splats(slot).with_context(model)?;
            let splats = splats.with_context(|| format!("{} has no splats", model()))?;
            let points = splats.splats.iter().map(|splat| {
                let area = opaque_area(splat.opacity, splat.deviations);
                // A guess tells nothing.
                let area = if splat.guessed { 0.0 } else { area };
                (
                    splat.mean,
                    usize::from(splat.bones[0].0),
                    splat.colour,
                    area,
                )
            });
            let person = ExamplePerson::new(&splats.skeleton, points);
            people.push(person.with_context(|| {
                format!(
                    "slot {slot} of {}: its joints are not those of SMPL",
                    model()
                )
            })?);
        }
        ensure!(!people.is_empty(), "{} has nobody", model());
        let decoder = Decoder::learn(&people, self.rank.into()).with_context(model)?;
        let notes: Vec<(&str, &str)> = (self.notes.iter())
            .map(|(name, text)| (name.as_str(), text.as_str()))
            .collect();
        let bytes = decoder.to_bytes(&notes)?;
        std::fs::write(&self.out, &bytes)
            .with_context(|| format!("writing {}", self.out.display()))?;
        say!(
            "{} people, codes of {} numbers, {} bytes: {}",
            people.len(),
            self.rank,
            bytes.len(),
            self.out.display()
        );
        output::put("files", output::paths(&[&self.out]));
        Ok(())
    }
}
