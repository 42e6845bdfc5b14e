//! `yoto-lab info`: the parts of a model and the size of each.

use anyhow::Context;
use clap::Args;
use std::collections::BTreeSet;
use std::path::PathBuf;
use yoto_avatar::avatar::PartCount;
use yoto_avatar::config::{Appearance, ModelConfig};
use yoto_avatar::train::{ModelState, read_parts};
use yoto_terminal::output;
use yoto_terminal::table::table;

const AFTER_HELP: &str = "\
A folder is a checkpoint's, as `yoto model export` writes it, or an imported model's.

Example:
  yoto-lab info checkpoints/000000002000";

/// Print a model's parts with their parameters and bytes.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(super) struct Info {
    /// Folder with weights.safetensors and state.json.
    #[arg(value_name = "DIR")]
    model: PathBuf,
}

impl Info {
    pub(super) fn run(self) -> anyhow::Result<()> {
        let path = &*self.model;
        let state = ModelState::read(path)?;
        let parts = read_parts(path)?;
        say!("folder      {}", path.display());
        about(&state.config, state.slots.iter().flatten().count());
        say!("joints      {}", state.joints);
        say!("steps       {}", state.step);
        let priors: BTreeSet<&String> = state.priors.values().collect();
        for prior in priors {
            say!("guesses by  the decoder of {prior}");
        }
        for entry in std::fs::read_dir(path).with_context(|| format!("{}", path.display()))? {
            let entry = entry?;
            let size = entry.metadata()?.len();
            say!("file        {}: {size} bytes", entry.file_name().display());
        }
        print_parts(&parts);
        Ok(())
    }
}

fn about(config: &ModelConfig, people: usize) {
    let name = |value: serde_json::Result<serde_json::Value>| {
        let text = value.ok().and_then(|v| v.as_str().map(str::to_owned));
        text.unwrap_or_else(|| "?".to_owned())
    };
    say!("tier        {}", config.tier);
    say!("variant     {}", name(serde_json::to_value(config.variant)));
    say!(
        "numerics    {}",
        name(serde_json::to_value(config.numerics))
    );
    match &config.appearance {
        Appearance::Splats(splats) => say!("splats      {} per person", splats.count),
        Appearance::Field(field) => say!("samples     {} per ray", field.march.samples),
    }
    say!("people      {people}");
}

fn print_parts(parts: &[PartCount]) {
    let row = |part: &str, parameters: u64, bytes: u64| {
        vec![part.to_owned(), parameters.to_string(), bytes.to_string()]
    };
    let mut rows: Vec<Vec<String>> = parts
        .iter()
        .map(|part| row(&part.part, part.parameters, part.bytes))
        .collect();
    let sum = |of: fn(&PartCount) -> u64| parts.iter().map(of).sum();
    let json = parts.iter().map(|part| {
        serde_json::json!({
            "part": part.part, "parameters": part.parameters, "bytes": part.bytes,
        })
    });
    output::put("parts", json.collect::<serde_json::Value>());
    rows.push(row("total", sum(|p| p.parameters), sum(|p| p.bytes)));
    say!("{}", table(&["PART", "PARAMETERS", "BYTES"], &rows));
}
