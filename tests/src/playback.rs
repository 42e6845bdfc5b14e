//! Films in a browser.

use crate::browser::Browser;
use anyhow::bail;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::Deserialize;
use serde_json::{Value, json};

const PLAYER: &str = include_str!("playback.html");

/// Properties of a film in a browser.
#[derive(Debug, Deserialize)]
pub struct Playback {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// How long it lasts.
    pub seconds: f64,
    /// Red in the middle of the pictures at the times that were asked for, as a screen shows it.
    pub reds: Vec<u8>,
}

/// Plays the MP4 `film` of `fps` pictures per second, and jumps to `times` in seconds.
///
/// # Errors
/// When the browser fails, or can't play it.
pub fn played(browser: &Browser, film: &[u8], fps: f64, times: &[f64]) -> anyhow::Result<Playback> {
    let address = json!(format!("data:video/mp4;base64,{}", STANDARD.encode(film)));
    let (times, frame) = (json!(times), json!(1.0 / fps));
    let page = PLAYER.replacen(
        "<script>",
        &format!(
            "<script>\nconst FILM = {address};\nconst TIMES = {times};\nconst FRAME = {frame};"
        ),
        1,
    );
    let found: Value = browser.found(&page)?;
    if let Some(error) = found["error"].as_str() {
        bail!("the browser does not play the film: {error}");
    }
    Ok(serde_json::from_value(found)?)
}
