//! Arguments and lines shared by several commands.

pub(super) use yoto_terminal::table::table;

use clap::builder::RangedU64ValueParser;
use yoto_proto::{checks::export, protocols, tiers, v1::Deleted};
use yoto_terminal::output;
use yoto_terminal::progress::count;

/// Tells that `what` was deleted, and what went with it.
pub(super) fn say_deleted(what: &str, deleted: &Deleted) {
    output::put("deleted", output::message(deleted));
    say!("{what} is deleted: {}", taken(deleted));
    tell!("its bytes go after the service's time of grace; `yoto gc --now` removes them now");
}

/// `2 checkpoints, 1 job`.
fn taken(deleted: &Deleted) -> String {
    let all = [
        (deleted.captures, "capture"),
        (deleted.checkpoints, "checkpoint"),
        (deleted.jobs, "job"),
    ];
    let all = all.iter().filter(|(number, _)| *number > 0);
    let all: Vec<String> = all
        .map(|(number, what)| count(*number as usize, what))
        .collect();
    match all.is_empty() {
        true => "it had nothing".to_owned(),
        false => all.join(", "),
    }
}

/// The longest side of pictures, in words; 0 is the captures' own.
pub(super) fn size_of(side: u32) -> String {
    match side {
        0 => "the captures' size".to_owned(),
        side => format!("{side} pixels"),
    }
}

/// Parses a tier's name.
pub(super) fn tier(text: &str) -> Result<String, String> {
    named(text, tiers::TIERS)
}

/// Parses a variant's name.
pub(super) fn variant(text: &str) -> Result<String, String> {
    named(text, tiers::VARIANTS)
}

/// Parses an evaluation protocol's name.
pub(super) fn protocol(text: &str) -> Result<String, String> {
    named(text, protocols::PROTOCOLS)
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

/// Parses the length of a distillation, seconds.
pub(super) fn distillation_seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if export::SECONDS.contains(&seconds) => Ok(seconds),
        _ => {
            let (least, most) = (export::SECONDS.start(), export::SECONDS.end());
            Err(format!("a number of seconds from {least} to {most}"))
        }
    }
}

/// A parser of the side of a distillation's pictures, pixels.
pub(super) fn distillation_sizes() -> RangedU64ValueParser<u32> {
    let (least, most) = (*export::SIZES.start(), *export::SIZES.end());
    RangedU64ValueParser::new().range(u64::from(least)..=u64::from(most))
}

/// Parses a PSNR in dB above 0.
pub(super) fn decibels(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("a number of dB above 0".to_owned()),
    }
}

/// Parses a render quality's name.
pub(super) fn render_tier(text: &str) -> Result<String, String> {
    let known = tiers::is_render_tier(text);
    known
        .then(|| text.to_owned())
        .ok_or_else(|| format!("one of: {}", tiers::render_tiers()))
}

/// `name: description` for each entry, for help texts.
pub(super) fn explained(table: &[(&str, &str)]) -> String {
    table
        .iter()
        .map(|(name, text)| format!("\n  {name:<18} {text}"))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_went_with_a_deletion_is_counted() {
        let deleted = Deleted {
            checkpoints: 2,
            jobs: 1,
            captures: 0,
        };
        assert_eq!(taken(&deleted), "2 checkpoints, 1 job");
        assert_eq!(taken(&Deleted::default()), "it had nothing");
    }
}
