//! What the check of a capture has found: its report, which a worker has written as JSON.

use super::asker::Asker;
use super::words::{badge, told};
use maud::{Markup, html};
use serde::Deserialize;
use tonic::Status;
use yoto_proto::keys::CHECK;
use yoto_proto::v1::Violation;
use yoto_store::CaptureFiles;

/// Longest report that is read, bytes: those of workers have a few thousand.
const LONGEST: usize = 1 << 20;
/// Most findings of one kind that are shown.
const MOST: usize = 40;

/// The report, as far as it is shown. A worker of another version may leave parts out.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct Report {
    grade: String,
    looked_at: u64,
    measures: Vec<Measure>,
    causes: Vec<Cause>,
    advice: Vec<String>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Measure {
    kind: String,
    grade: String,
    shown: String,
    meaning: String,
    cause: Option<String>,
    frames: Vec<u32>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Cause {
    what: String,
    options: String,
}

/// The report of a capture's check; `None` where there is none, or it is none of this form.
///
/// # Errors
/// When the service can't read it.
pub(crate) async fn read(asker: &Asker, capture: &CaptureFiles) -> Result<Option<Report>, Status> {
    let Some(object) = capture.object(CHECK) else {
        return Ok(None);
    };
    let capture = &capture.capture.name;
    let Some(bytes) = asker.backend().object(object, LONGEST).await? else {
        tracing::warn!(capture, "the check's report is too long");
        return Ok(None);
    };
    match serde_json::from_slice(&bytes) {
        Ok(report) => Ok(Some(report)),
        Err(error) => {
            tracing::warn!(capture, %error, "the check's report can't be read");
            Ok(None)
        }
    }
}

impl Report {
    /// The worst grade, as a badge.
    pub(crate) fn grade(&self) -> Markup {
        grade(&self.grade)
    }

    /// The measures, the worst first, and what they mean.
    pub(crate) fn table(&self) -> Markup {
        let rank = |it: &&Measure| match it.grade.as_str() {
            "fail" => 0,
            "warn" => 1,
            _ => 2,
        };
        let mut measures: Vec<&Measure> = self.measures.iter().take(MOST).collect();
        measures.sort_by_key(rank);
        html! {
            @for cause in self.causes.iter().take(MOST) {
                p .message {
                    (told(&cause.what))
                    @if !cause.options.is_empty() { ": try " code { (told(&cause.options)) } }
                }
            }
            @if !self.advice.is_empty() {
                ul .advice { @for line in self.advice.iter().take(MOST) { li { (told(line)) } } }
            }
            @if !measures.is_empty() {
                div .scroll tabindex="0" role="group" aria-label="Table" { table {
                    caption { (self.looked_at) " frames were looked at" }
                    thead { tr { th { "Grade" } th { "Measure" } th { "Value" } th { "Meaning" } } }
                    tbody {
                        @for it in measures {
                            tr {
                                td { (grade(&it.grade)) }
                                th scope="row" { (told(&it.kind.replace('_', " "))) }
                                td { (told(&it.shown)) }
                                td .text {
                                    (told(&it.meaning))
                                    @if let Some(cause) = &it.cause { "; " (told(cause)) }
                                    @if it.grade != "pass" && !it.frames.is_empty() { " (frames " (listed(&it.frames)) ")" }
                                }
                            }
                        }
                    }
                } }
            }
        }
    }
}

fn listed(frames: &[u32]) -> String {
    let shown: Vec<String> = frames.iter().take(6).map(u32::to_string).collect();
    shown.join(", ")
}

fn grade(grade: &str) -> Markup {
    match grade {
        "pass" => badge("good", "pass"),
        "warn" => badge("warn", "warn"),
        "fail" => badge("bad", "fail"),
        other => badge("calm", &told(other)),
    }
}

/// Faults of a user's files, each with its place.
pub(crate) fn violations(violations: &[Violation]) -> Markup {
    html! {
        @if !violations.is_empty() {
            ul .faults {
                @for it in violations.iter().take(MOST) {
                    li {
                        @if !it.file.is_empty() { code { (told(&it.file)) } " " }
                        @if let Some(frame) = it.frame { "frame " (frame) " " }
                        @if !it.field.is_empty() { code { (told(&it.field)) } " " }
                        (told(&it.message))
                    }
                }
                @if violations.len() > MOST { li { (violations.len() - MOST) " more" } }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_report_is_shown_worst_first_and_as_text() {
        let json = r#"{"frames": 9, "looked_at": 5, "grade": "warn", "new": 1, "measures": [
            {"kind": "blur", "grade": "pass", "value": 1.0, "shown": "1 px", "meaning": "sharp", "cause": null, "frames": [3]},
            {"kind": "view_coverage", "grade": "warn", "shown": "<img src=x>", "meaning": "few", "cause": "a\u202eb", "frames": [1, 2]}],
            "advice": ["turn <b>once</b>"], "causes": [{"what": "cameras", "options": "--a"}]}"#;
        let report: Report = serde_json::from_str(json).expect("a report");
        let table = report.table().into_string();
        let place = |text: &str| {
            table
                .find(text)
                .unwrap_or_else(|| panic!("{text} in {table}"))
        };
        assert!(place("view coverage") < place("blur"));
        place("&lt;img src=x&gt;");
        place("a\\u{202e}b");
        place("(frames 1, 2)");
        place("turn &lt;b&gt;once");
        assert!(!table.contains("frames 3"), "a pass needs no frames");
        let empty: Report = serde_json::from_str("{}").expect("a report");
        assert_eq!(empty.table().into_string(), "");
    }
}
