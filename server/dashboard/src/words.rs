//! Words and figures for people.

use maud::{Markup, html};
use prost_types::Timestamp;
use yoto_proto::text::{LINE_CHARACTERS, one_line};
use yoto_proto::v1::{Job, JobKind, capture, job, subject};

/// Characters of an id that tell it from others.
const ID: usize = 8;

/// What others wrote, as one line without hidden characters. Markup in it is escaped where it is printed.
pub(crate) fn told(text: &str) -> String {
    one_line(text, LINE_CHARACTERS)
}

/// What others wrote, apart from the direction of the text around it.
pub(crate) fn name(text: &str) -> Markup {
    html! { bdi { (told(text)) } }
}

/// The beginning of the id in a resource's name.
pub(crate) fn short(name: &str) -> String {
    let id = name.rsplit('/').next().unwrap_or_default();
    id.chars().take(ID).collect()
}

/// Where the page of a resource is.
pub(crate) fn page_of(name: &str) -> String {
    match name.strip_prefix("subjects/") {
        Some(id) => format!("/people/{id}"),
        None => format!("/{name}"),
    }
}

/// A time span in its largest unit.
pub(crate) fn span(seconds: f64) -> String {
    let seconds = seconds.max(0.0) as u64;
    match seconds {
        0..60 => format!("{seconds} s"),
        60..3600 => format!("{} min", seconds / 60),
        3600..86_400 => format!("{} h", seconds / 3600),
        _ => format!("{} d", seconds / 86_400),
    }
}

/// A number of bytes.
pub(crate) fn bytes(number: u64) -> String {
    let units = ["KiB", "MiB", "GiB", "TiB"];
    let mut value = number as f64;
    if value < 1024.0 {
        return format!("{number} bytes");
    }
    let mut unit = "";
    for next in units {
        if value < 1024.0 {
            break;
        }
        value /= 1024.0;
        unit = next;
    }
    format!("{value:.1} {unit}")
}

/// A whole number, with a thin space between its thousands.
pub(crate) fn whole(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::with_capacity(digits.len() + digits.len() / 3);
    for (at, digit) in digits.chars().enumerate() {
        if at > 0 && (digits.len() - at).is_multiple_of(3) && digits.len() > 4 {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

/// `1 frame`, `2 frames`.
pub(crate) fn count(number: u64, what: &str) -> String {
    match number {
        1 => format!("1 {what}"),
        number => format!("{} {what}s", whole(number)),
    }
}

/// Seconds since 1970.
pub(crate) fn seconds(time: &Timestamp) -> f64 {
    time.seconds as f64 + f64::from(time.nanos) * 1e-9
}

/// How long before `now`, seconds since 1970, something was; with the exact time for programs and as a hint.
pub(crate) fn ago(now: f64, time: Option<&Timestamp>) -> Markup {
    let Some(time) = time else {
        return html! { "–" };
    };
    let exact = time.to_string();
    html! { time datetime=(exact) title=(exact) { (span(now - seconds(time))) " ago" } }
}

/// The word of a job's kind.
pub(crate) fn kind(job: &Job) -> &'static str {
    kind_word(job.kind())
}

/// The word of a kind of jobs.
pub(crate) fn kind_word(kind: JobKind) -> &'static str {
    match kind {
        JobKind::Ingest => "ingest",
        JobKind::Train => "training",
        JobKind::Render => "render",
        JobKind::Evaluate => "evaluation",
        JobKind::Export => "export",
        JobKind::Unspecified => "job",
    }
}

/// The state of a job, with a colour beside the word.
pub(crate) fn job_state(job: &Job) -> Markup {
    let (class, word) = match job.state() {
        job::State::Queued if job.waiting.is_some() => ("warn", "waiting"),
        job::State::Queued => ("calm", "queued"),
        job::State::Running if job.cancel_requested => ("warn", "stopping"),
        job::State::Running => ("busy", "running"),
        job::State::Succeeded => ("good", "succeeded"),
        job::State::Failed => ("bad", "failed"),
        job::State::Cancelled => ("calm", "cancelled"),
        job::State::Unspecified => ("calm", "unknown"),
    };
    badge(class, word)
}

/// The state of a person.
pub(crate) fn subject_state(state: subject::State) -> Markup {
    let (class, word) = match state {
        subject::State::Uploading => ("busy", "uploading"),
        subject::State::Ingesting => ("busy", "being read"),
        subject::State::Ready => ("good", "ready"),
        subject::State::Rejected => ("bad", "rejected"),
        subject::State::Erased => ("calm", "erased"),
        subject::State::Uploaded => ("warn", "not read"),
        subject::State::Unspecified => ("calm", "no capture"),
    };
    badge(class, word)
}

/// The state of a capture.
pub(crate) fn capture_state(state: capture::State) -> Markup {
    let (class, word) = match state {
        capture::State::Uploading => ("busy", "uploading"),
        capture::State::Ingesting => ("busy", "being read"),
        capture::State::Ready => ("good", "ready"),
        capture::State::Rejected => ("bad", "rejected"),
        capture::State::Uploaded => ("warn", "not read"),
        capture::State::Unspecified => ("calm", "unknown"),
    };
    badge(class, word)
}

/// A word with a colour, which repeats what the word says.
pub(crate) fn badge(class: &str, word: &str) -> Markup {
    html! { span class={ "badge " (class) } { (word) } }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_short() {
        let spans = [-1.0, 59.9, 61.0, 3599.0, 90_000.0].map(span);
        assert_eq!(spans, ["0 s", "59 s", "1 min", "59 min", "1 d"]);
        let sizes = [0, 1023, 1024, 3 << 30, u64::MAX].map(bytes);
        let expected = [
            "0 bytes",
            "1023 bytes",
            "1.0 KiB",
            "3.0 GiB",
            "16777216.0 TiB",
        ];
        assert_eq!(sizes, expected);
        let numbers = [0, 9999, 10_000, 1_234_567].map(whole);
        assert_eq!(
            numbers,
            ["0", "9999", "10\u{202f}000", "1\u{202f}234\u{202f}567"]
        );
        assert_eq!(
            (count(1, "frame"), count(0, "frame")),
            ("1 frame".into(), "0 frames".into())
        );
    }

    #[test]
    fn what_others_wrote_is_no_markup() {
        let shown = name("<b>\u{202e}x\u{1b}").into_string();
        assert_eq!(shown, "<bdi>&lt;b&gt;\\u{202e}x\\u{1b}</bdi>");
    }

    #[test]
    fn resources_have_pages() {
        assert_eq!(page_of("subjects/1"), "/people/1");
        assert_eq!(page_of("models/1"), "/models/1");
        assert_eq!(short("jobs/0123456789"), "01234567");
    }
}
