//! Parsers of option values, and help texts that list them.

use clap::builder::RangedU64ValueParser;
use yoto_proto::checks::export;
use yoto_proto::{protocols, tiers};

/// Parses a tier's name.
pub(crate) fn tier(text: &str) -> Result<String, String> {
    named(text, tiers::TIERS)
}

/// Parses a variant's name.
pub(crate) fn variant(text: &str) -> Result<String, String> {
    named(text, tiers::VARIANTS)
}

/// Parses an evaluation protocol's name.
pub(crate) fn protocol(text: &str) -> Result<String, String> {
    named(text, protocols::PROTOCOLS)
}

fn named(text: &str, table: &[(&str, &str)]) -> Result<String, String> {
    let known = table.iter().any(|(name, _)| *name == text);
    known
        .then(|| text.to_owned())
        .ok_or_else(|| format!("one of: {}", tiers::listed(table)))
}

/// Parses a length of time in seconds above 0.
pub(crate) fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("a number of seconds above 0".to_owned()),
    }
}

/// Parses the length of a distillation, seconds.
pub(crate) fn distillation_seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if export::SECONDS.contains(&seconds) => Ok(seconds),
        _ => {
            let (least, most) = (export::SECONDS.start(), export::SECONDS.end());
            Err(format!("a number of seconds from {least} to {most}"))
        }
    }
}

/// A parser of the side of a distillation's pictures, pixels.
pub(crate) fn distillation_sizes() -> RangedU64ValueParser<u32> {
    let (least, most) = (*export::SIZES.start(), *export::SIZES.end());
    RangedU64ValueParser::new().range(u64::from(least)..=u64::from(most))
}

/// Parses a PSNR in dB above 0.
pub(crate) fn decibels(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("a number of dB above 0".to_owned()),
    }
}

/// Parses a render quality's name.
pub(crate) fn render_tier(text: &str) -> Result<String, String> {
    let known = tiers::is_render_tier(text);
    known
        .then(|| text.to_owned())
        .ok_or_else(|| format!("one of: {}", tiers::render_tiers()))
}

/// `name: description` for each entry, for help texts.
pub(crate) fn explained(table: &[(&str, &str)]) -> String {
    table
        .iter()
        .map(|(name, text)| format!("\n  {name:<18} {text}"))
        .collect()
}

/// Help text of `--tier`.
pub(crate) fn tier_help() -> String {
    format!(
        "Quality tier: a trade-off of speed and detail.{}",
        explained(tiers::TIERS)
    )
}

/// Help text of `--variant`.
pub(crate) fn variant_help() -> String {
    format!(
        "Model variant of the paper's ablation.{}",
        explained(tiers::VARIANTS)
    )
}
