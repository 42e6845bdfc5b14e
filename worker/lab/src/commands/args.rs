//! Values of options that several commands have.

use std::sync::Arc;
use yoto_avatar::config::{LearnExposure, Refine};
use yoto_avatar::decoder::{Decoder, Prior};
use yoto_proto::protocols::PROTOCOLS;
use yoto_proto::tiers::{self, TIERS, VARIANTS};

/// Parses a tier's name.
pub(super) fn tier(text: &str) -> Result<String, String> {
    named(text, TIERS)
}

/// Parses a variant's name.
pub(super) fn variant(text: &str) -> Result<String, String> {
    named(text, VARIANTS)
}

/// Parses the name of an evaluation protocol.
pub(super) fn protocol(text: &str) -> Result<String, String> {
    named(text, PROTOCOLS)
}

fn named(text: &str, table: &[(&str, &str)]) -> Result<String, String> {
    let known = table.iter().any(|(name, _)| *name == text);
    known
        .then(|| text.to_owned())
        .ok_or_else(|| format!("one of: {}", tiers::listed(table)))
}

/// Parses a length of time in seconds above 0.
pub(super) fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("a number of seconds above 0".to_owned()),
    }
}

/// Parses the size of compared pictures, pixels: large enough for SSIM, or 0.
pub(super) fn compared_size(text: &str) -> Result<u32, String> {
    match text.parse::<u32>() {
        Ok(size @ (0 | 16..=4096)) => Ok(size),
        _ => Err("0, or 16 to 4096 pixels".to_owned()),
    }
}

/// Parses what is known of people before a training: a word, or a decoder's file.
pub(super) fn prior(text: &str) -> Result<Prior, String> {
    match text {
        "none" => return Ok(Prior::None),
        "people" => return Ok(Prior::People),
        _ => {}
    }
    let bytes = std::fs::read(text)
        .map_err(|error| format!("neither people nor none, nor a decoder's file: {error}"))?;
    let decoder = Decoder::from_bytes(&bytes).map_err(|error| error.to_string())?;
    Ok(Prior::Own(Arc::new(decoder)))
}

/// Parses whose poses are refined.
pub(super) fn refine_poses(text: &str) -> Result<Refine, String> {
    match text {
        "always" => Ok(Refine::Always),
        "never" => Ok(Refine::Never),
        "auto" => Ok(Refine::Auto),
        _ => Err(WHEN.to_owned()),
    }
}

/// Parses for whose films exposures are learned.
pub(super) fn exposure(text: &str) -> Result<LearnExposure, String> {
    match text {
        "always" => Ok(LearnExposure::Always),
        "never" => Ok(LearnExposure::Never),
        "auto" => Ok(LearnExposure::Auto),
        _ => Err(WHEN.to_owned()),
    }
}

const WHEN: &str = "one of: always, never, auto";

pub(super) fn tier_help() -> String {
    explained("Quality tier: a trade-off of speed and detail.", TIERS)
}

pub(super) fn variant_help() -> String {
    explained("Model variant of the paper's ablation.", VARIANTS)
}

pub(super) fn protocol_help() -> String {
    explained("Pictures to compare, and the method.", PROTOCOLS)
}

/// The help text of an option, with a line for each of its values.
fn explained(option: &str, values: &[(&str, &str)]) -> String {
    let lines = values.iter();
    let lines = lines.map(|(name, text)| format!("\n  {name:<18} {text}"));
    option.to_owned() + &lines.collect::<String>()
}
