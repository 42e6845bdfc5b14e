//! `yoto model info`: the parts of a model and the size of each.

use super::{Server, table};
use anyhow::Context;
use clap::Args;
use std::path::{Path, PathBuf};
use yoto_avatar::avatar::{Avatar, PartCount};
use yoto_avatar::config::{Appearance, ModelConfig};
use yoto_avatar::train::{ModelState, read_parts};
use yoto_terminal::output;

pub(super) const AFTER_HELP: &str = "\
A folder is a checkpoint's or an imported model's. The sizes of a model of the service
follow from its tier, variant and people.

Examples:
  yoto model info checkpoints/000000002000
  yoto model info duo";

#[derive(Debug, Args)]
pub(super) struct Info {
    /// Folder with weights.safetensors and state.json, or the name of a model of the service.
    #[arg(value_name = "PATH|MODEL")]
    model: String,
    /// Joints of the people's skeletons, for a model of the service.
    #[arg(long, default_value_t = 24, value_parser = clap::value_parser!(u16).range(2..=256))]
    joints: u16,
    #[command(flatten)]
    server: Server,
}

impl Info {
    pub(super) async fn run(self) -> anyhow::Result<()> {
        let path = PathBuf::from(&self.model);
        if path.is_dir() {
            return of_folder(&path);
        }
        let client = self.server.connect().await?;
        let model = client.find_model(&self.model).await?;
        let config = ModelConfig::named(&model.tier, &model.variant)
            .with_context(|| format!("the model {}", model.name))?;
        say!("model       {} ({})", model.display_name, model.name);
        about(&config, model.slots.len());
        for checkpoint in client.list_checkpoints(&model.name).await? {
            let measured = match checkpoint.tradeoff {
                Some(_) => ", trade-off measured",
                None => "",
            };
            let psnr = checkpoint
                .psnr
                .map(|psnr| format!(", {psnr:.2} dB held out"));
            let best = if checkpoint.best { ", the best" } else { "" };
            say!(
                "checkpoint  step {}, {} bytes{}{best}{measured}",
                checkpoint.step,
                checkpoint.bytes,
                psnr.unwrap_or_default()
            );
        }
        let slots = model.slots.len().max(1);
        let device = yoto_device::pick().device;
        let avatar = Avatar::new(&config, slots, usize::from(self.joints), 0, &device);
        print_parts(&avatar.part_counts());
        Ok(())
    }
}

fn of_folder(path: &Path) -> anyhow::Result<()> {
    let state = ModelState::read(path)?;
    let parts = read_parts(path)?;
    say!("folder      {}", path.display());
    about(&state.config, state.slots.iter().flatten().count());
    say!("joints      {}", state.joints);
    say!("steps       {}", state.step);
    for entry in std::fs::read_dir(path).with_context(|| format!("{}", path.display()))? {
        let entry = entry?;
        let size = entry.metadata()?.len();
        say!("file        {}: {size} bytes", entry.file_name().display());
    }
    print_parts(&parts);
    Ok(())
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
    say!("{}", table::table(&["PART", "PARAMETERS", "BYTES"], &rows));
}
