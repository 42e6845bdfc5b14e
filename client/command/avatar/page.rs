//! The page: the avatar to turn with the mouse, in motion, and what the clip was like.

use super::AvatarReport;
use anyhow::Context;
use std::fmt::Write;
use std::path::Path;
use yoto_capture::check::Grade;
use yoto_player::escaped;
use yoto_terminal::progress::duration;

/// Template of the page, with fields in braces.
const PAGE: &str = include_str!("page.html");

/// Writes the page about `report` to `path`, beside which the report's pictures are; `caption` says
/// which motion they show.
pub(super) fn write(path: &Path, report: &AvatarReport, caption: &str) -> anyhow::Result<()> {
    put(path, &page(report, caption))
}

/// Replaces the page at `path` at once: a browser that reads it meanwhile gets the old or the new one.
pub(super) fn put(path: &Path, page: &str) -> anyhow::Result<()> {
    let part = path.with_extension("html.part");
    std::fs::write(&part, page)
        .and_then(|()| std::fs::rename(&part, path))
        .with_context(|| format!("writing {}", path.display()))
}

fn page(report: &AvatarReport, caption: &str) -> String {
    let pictures: Vec<String> = report
        .orbit
        .iter()
        .map(|path| path.display().to_string().replace('\\', "/"))
        .collect();
    // JSON in a script: no text of it may end the script.
    let list = serde_json::to_string(&pictures)
        .unwrap_or_default()
        .replace('<', "\\u003c");
    let first = pictures.first().map(String::as_str).unwrap_or_default();
    PAGE.replace("{name}", &escaped(&report.name))
        .replace("{size}", &report.size.to_string())
        .replace("{first}", &escaped(first))
        .replace("{pictures}", &list)
        .replace("{caption}", &escaped(caption))
        .replace("{figures}", &figures(report))
        .replace("{check}", &check(report))
        .replace("{notes}", &notes(report))
}

/// Rows of the table of figures.
fn figures(report: &AvatarReport) -> String {
    let [width, height] = report.image_size;
    let mut rows = vec![(
        "Clip",
        format!(
            "{} frames of {width}×{height} with the person, {:.0} per second",
            report.frames, report.fps
        ),
    )];
    if let Some(training) = &report.training {
        let quality = training.psnr_box.zip(training.psnr);
        let quality = quality.map_or_else(
            || "not measured: no frame was held out".to_owned(),
            |(inside, whole)| {
                format!(
                    "{inside:.2} dB in the person's box, {whole:.2} dB whole, on {} held-out frames",
                    training.held_out
                )
            },
        );
        rows.push(("Quality", quality));
        if let Some(share) = training.guessed {
            let percent = 100.0 * share;
            let told = format!(
                "{percent:.0} % of the surface is in no frame: its colours are guessed; the player can tint it"
            );
            rows.push(("Guessed", told));
        }
        rows.push((
            "Training",
            format!(
                "{} steps in {} on {}",
                training.steps,
                duration(report.seconds.training),
                training.device
            ),
        ));
    }
    rows.push((
        "Time",
        format!(
            "{} in all; {:.2} s per picture",
            duration(report.seconds.total),
            report.seconds.per_picture
        ),
    ));
    rows.iter().fold(String::new(), |mut text, (name, value)| {
        let _ = writeln!(text, "<tr><th>{name}</th><td>{}</td></tr>", escaped(value));
        text
    })
}

/// Rows of the check's table.
pub(super) fn check(report: &AvatarReport) -> String {
    report.check.iter().fold(String::new(), |mut text, it| {
        let cause = it.cause.as_deref().filter(|_| it.grade != Grade::Pass);
        let _ = writeln!(
            text,
            "<tr class=\"{grade}\"><td>{grade}</td><th>{}</th><td>{}</td><td>{}</td></tr>",
            escaped(it.kind.title()),
            escaped(&it.shown),
            escaped(cause.unwrap_or(&it.meaning)),
            grade = it.grade.name(),
        );
        text
    })
}

fn notes(report: &AvatarReport) -> String {
    let training = report.training.iter().flat_map(|it| &it.notes);
    report
        .notes
        .iter()
        .chain(training)
        .fold(String::new(), |mut text, note| {
            let _ = writeln!(text, "<li>{}</li>", escaped(note));
            text
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::avatar::report::Seconds;

    #[test]
    fn a_page_shows_its_pictures_and_no_text_becomes_markup() {
        let report = AvatarReport {
            name: "<b>Ada</b> {notes}".into(),
            frames: 3,
            image_size: [64, 96],
            fps: 30.0,
            notes: vec!["focal < 5 & \"wide\"".into()],
            check: Vec::new(),
            causes: Vec::new(),
            lacks: Vec::new(),
            orbit_frame: 1,
            size: 64,
            training: None,
            orbit: vec!["pictures/orbit/000000.png".into()],
            motion: Vec::new(),
            seconds: Seconds::default(),
        };
        let page = page(&report, "In a motion <new>.");
        assert!(
            page.contains("&lt;b&gt;Ada&lt;/b&gt; &#123;notes}"),
            "{page}"
        );
        assert!(page.contains("<li>focal &lt; 5 &amp; &quot;wide&quot;</li>"));
        assert!(page.contains("<figcaption>In a motion &lt;new&gt;.</figcaption>"));
        assert!(page.contains("[\"pictures/orbit/000000.png\"]"));
        for field in [
            "{name}",
            "{size}",
            "{caption}",
            "{pictures}",
            "{figures}",
            "{check}",
            "{notes}",
        ] {
            assert!(!page.contains(field), "{field} is left");
        }
    }
}
