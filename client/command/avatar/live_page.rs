//! The HTML of the page while the person is trained.

use super::live::{CheckpointPicture, OFTEN, WorkState};
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use yoto_player::escaped;

/// Template of the page, with fields in braces.
const PAGE: &str = include_str!("live_page.html");
/// Age at which a browser stops reloading the page: the program was killed, or can't write.
const STALE: Duration = Duration::from_secs(90);

/// The page about the person called `name`, with the rows of the check of their capture.
pub(super) fn html(name: &str, check: &str, state: &WorkState) -> String {
    let title = match &state.stopped {
        Some(_) => "stopped",
        None => "training",
    };
    PAGE.replace("{name}", &escaped(name))
        .replace("{title}", title)
        .replace("{state}", &words(state))
        .replace("{pictures}", &pictures(&state.pictures))
        .replace("{check}", check)
        .replace("{refresh}", &refresh(state))
}

fn words(state: &WorkState) -> String {
    if let Some(why) = &state.stopped {
        return format!(
            "<p class=\"stopped\">There is no avatar: {}.</p>\n<p>It stopped at: {}</p>",
            escaped(why),
            escaped(&state.doing)
        );
    }
    let bar = state.fraction.map_or_else(String::new, |fraction| {
        format!("\n<progress value=\"{fraction:.3}\"></progress>")
    });
    format!("<p id=\"state\">{}</p>{bar}", escaped(&state.doing))
}

/// The newest picture, and the earlier ones below.
fn pictures(all: &[CheckpointPicture]) -> String {
    let figure = |it: &CheckpointPicture| {
        let quality = it
            .psnr
            .map_or_else(String::new, |psnr| format!(", {psnr:.2} dB"));
        let path = escaped(&it.path);
        format!(
            "<figure><img src=\"{path}\" alt=\"Step {0}\"><figcaption>Step {0}{quality}</figcaption></figure>\n",
            it.step
        )
    };
    let Some((newest, earlier)) = all.split_last() else {
        return "<p>The first picture comes with the first measured checkpoint.</p>".to_owned();
    };
    let mut text = format!(
        "<p>Left: a frame that is held out of training. Right: its render.</p>\n{}",
        figure(newest)
    );
    if !earlier.is_empty() {
        text += "<div class=\"strip\">\n";
        for it in earlier.iter().rev() {
            text += &figure(it);
        }
        text += "</div>";
    }
    text
}

/// The script that reloads the page. A page that is older than [`STALE`] is not reloaded, and says so.
fn refresh(state: &WorkState) -> String {
    if state.stopped.is_some() {
        return String::new();
    }
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    let (often, stale) = (OFTEN.as_millis(), STALE.as_millis());
    format!(
        "<script>\n  if (Date.now() - {} < {stale}) setTimeout(() => location.reload(), {often});\n  \
         else document.getElementById(\"state\").textContent = \"No update for {} seconds: the program was killed, \
         or can't write this page. Reload it to look again.\";\n</script>\n",
        now.unwrap_or_default().as_millis(),
        STALE.as_secs()
    )
}
