//! The contents of exported pages.

use anyhow::Context;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;

/// Names and frames of the clips in a page.
///
/// # Errors
/// When it is not an exported page.
pub fn clips(page: &str) -> anyhow::Result<Vec<(String, usize)>> {
    let data = page.split(r#"id="person">"#).nth(1).context("no person")?;
    let data = data.split("</script>").next().context("no end")?;
    let data: serde_json::Value = serde_json::from_str(data)?;
    let joints = data["joints"].as_array().context("joints")?.len();
    let clips = data["clips"].as_array().context("clips")?.iter();
    let clips = clips.map(|clip| {
        let poses = STANDARD.decode(clip["poses"].as_str().context("poses")?)?;
        // A shift of 12 bytes, and 8 of each joint.
        let frames = poses.len() / (12 + 8 * joints);
        Ok((clip["name"].as_str().context("name")?.to_owned(), frames))
    });
    clips.collect()
}
