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
struct Found {
    /// What the page does wrong, in words.
    faults: Vec<String>,
    /// The address of a PNG's data.
    picture: String,
}

/// Tries the controls of an exported `page`. Returns the picture that it draws after `yoto.hold(hold)`.
///
/// # Errors
/// When the browser fails, or the page does not do what its help says.
pub fn tried(browser: &Browser, page: &str, hold: &Value) -> anyhow::Result<RgbaImage> {
    let head = format!("<head><script>{SCRIPT}\nconst HOLD = {hold};</script>");
    let inner = page.replacen("<head>", &head, 1);
    let inner = inner.replace('&', "&amp;").replace('"', "&quot;");
    // Windows of browsers are wider than a phone's; frames in them are not.
    let outer = format!(
        "<!doctype html><body><iframe style='width: 390px; height: 844px; border: 0' srcdoc=\"{inner}\"></iframe></body>"
    );
    let found: Found = browser.found(&outer)?;
    let faults = found.faults.join("; ");
    ensure!(faults.is_empty(), "on a phone: {faults}");
    let picture = found.picture.strip_prefix("data:image/png;base64,");
    let picture = STANDARD.decode(picture.context("no picture of the page")?)?;
    Ok(image::load_from_memory(&picture)?.to_rgba8())
}
