//! Exported pages on a phone: in a window of its size, with keys pressed and sliders moved.

use crate::browser::Browser;
use anyhow::{Context, ensure};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::RgbaImage;
use serde::Deserialize;
use serde_json::Value;

const SCRIPT: &str = include_str!("phone.js");

/// What [`SCRIPT`] leaves.
#[derive(Deserialize)]
struct PhoneFindings {
    /// What the page does wrong, in words.
    faults: Vec<String>,
    /// The address of a PNG's data.
    picture: String,
}

/// The `page` of somebody with `bits` of guessed splats, one each.
fn with_guesses(page: &str, bits: &[u8]) -> anyhow::Result<String> {
    let (before, rest) = page.split_once(r#""guessed":""#).context("no guesses")?;
    let (_, after) = rest.split_once('"').context("no end of the guesses")?;
    let bits = STANDARD.encode(bits);
    Ok(format!(r#"{before}"guessed":"{bits}"{after}"#))
}

/// Bits that say that the first half of the splats of a `page` is guessed.
fn first_half(page: &str) -> anyhow::Result<Vec<u8>> {
    let (_, count) = page.split_once(r#""count":"#).context("no count")?;
    let count: usize = count.split(',').next().context("no number")?.parse()?;
    let mut bits = vec![0u8; count.div_ceil(8)];
    for splat in 0..count / 2 {
        bits[splat / 8] |= 1 << (splat % 8);
    }
    Ok(bits)
}

/// Tries the controls of an exported `page`, with guessed splats and without any. Returns the picture that it draws after
/// `yoto.hold(hold)`.
///
/// # Errors
/// When the browser fails, or the page does not do what its help says.
pub fn tried(browser: &Browser, page: &str, hold: &Value) -> anyhow::Result<RgbaImage> {
    let half = with_guesses(page, &first_half(page)?)?;
    let guessed = found(browser, &half, &format!("HOLD = {hold}, GUESSED = true"))?;
    let none = with_guesses(page, &[])?;
    let seen = found(browser, &none, &format!("HOLD = {hold}, GUESSED = false"))?;
    ensure!(
        guessed == seen,
        "guesses that are not tinted look otherwise"
    );
    Ok(guessed)
}

/// The picture that a `page` draws after [`SCRIPT`] has tried it with these `constants`.
fn found(browser: &Browser, page: &str, constants: &str) -> anyhow::Result<RgbaImage> {
    let head = format!("<head><script>{SCRIPT}\nconst {constants};</script>");
    let inner = page.replacen("<head>", &head, 1);
    let inner = inner.replace('&', "&amp;").replace('"', "&quot;");
    // Windows of browsers are wider than a phone's; frames in them are not.
    let outer = format!(
        "<!doctype html><body><iframe style='width: 390px; height: 844px; border: 0' srcdoc=\"{inner}\"></iframe></body>"
    );
    let found: PhoneFindings = browser.found(&outer)?;
    let faults = found.faults.join("; ");
    ensure!(faults.is_empty(), "on a phone: {faults}");
    let picture = found.picture.strip_prefix("data:image/png;base64,");
    let picture = STANDARD.decode(picture.context("no picture of the page")?)?;
    Ok(image::load_from_memory(&picture)?.to_rgba8())
}
