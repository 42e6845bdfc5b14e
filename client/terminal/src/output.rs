//! The command line's output: results on stdout, as text for people or as one JSON object for programs,
//! and everything else on stderr.
//!
//! Control characters are printed as escapes, so that no text acts on the terminal. Text that others wrote goes through
//! [`others`] where it must stay on one line.
//!
//! A reader that goes away, such as `head`, ends the program quietly; `println!` would panic.
//!
//! A command that says little keeps the rest in a log: see [`log`].

pub mod log;

use prost::{Message, Name};
use prost_reflect::{DescriptorPool, DynamicMessage, SerializeOptions};
use serde_json::{Map, Value};
use std::fmt::Arguments;
use std::io::{ErrorKind, Write};
use std::path::Path;
use std::sync::{LazyLock, Mutex, OnceLock, PoisonError};
use yoto_proto::text::{LINE_CHARACTERS, one_line, visible};

/// What a command shows.
#[derive(Debug, Clone, Copy, Default)]
pub struct Style {
    /// Results as JSON in place of text.
    pub json: bool,
    /// No notes.
    pub quiet: bool,
    /// No progress.
    pub no_progress: bool,
    /// No details: notes that only some people need.
    pub brief: bool,
}

static STYLE: OnceLock<Style> = OnceLock::new();
/// The results so far, for JSON.
static RESULTS: LazyLock<Mutex<Map<String, Value>>> = LazyLock::new(Mutex::default);

/// Sets the style of this process; the first one stays.
pub fn set_style(style: Style) {
    STYLE.get_or_init(|| style);
}

/// The style of this process.
pub fn style() -> Style {
    STYLE.get().copied().unwrap_or_default()
}

/// A text that somebody else wrote, in one line: a note, an error, a name.
pub fn others(text: &str) -> String {
    one_line(text, LINE_CHARACTERS)
}

/// Prints a line of a result for people. [`crate::say`] formats it.
pub fn line(text: Arguments<'_>) {
    let text = kept(text);
    if !style().json {
        write_out(&text);
    }
}

/// Prints a note for people on stderr. [`crate::tell`] formats it.
pub fn note(text: Arguments<'_>) {
    show(&kept(text));
}

/// Prints a note unless the style is brief. [`crate::detail`] formats it.
pub fn detail(text: Arguments<'_>) {
    let text = kept(text);
    if !style().brief {
        show(&text);
    }
}

/// Prints a line on stderr that is soon out of date, such as progress; no log keeps it.
pub fn passing(text: Arguments<'_>) {
    show(&visible(&text.to_string()));
}

/// `text` as a terminal may show it, after the log has it.
pub(crate) fn kept(text: Arguments<'_>) -> String {
    let text = visible(&text.to_string()).into_owned();
    log::keep(&text);
    text
}

fn show(text: &str) {
    if !style().quiet {
        // A failed write to stderr can't be reported.
        let _ = writeln!(std::io::stderr().lock(), "{text}");
    }
}

/// Prints an error on stderr, and adds it to the result for programs.
pub fn error(text: Arguments<'_>) {
    let text = text.to_string();
    let shown = kept(format_args!("error: {text}"));
    let _ = writeln!(std::io::stderr().lock(), "{shown}");
    put("error", text);
}

/// Adds a part of the result for programs, under `name`.
pub fn put(name: &str, value: impl Into<Value>) {
    let mut results = RESULTS.lock().unwrap_or_else(PoisonError::into_inner);
    results.insert(name.to_owned(), value.into());
}

/// Prints the result for programs, if the style asks for it.
pub fn finish() {
    if style().json {
        let results = RESULTS.lock().unwrap_or_else(PoisonError::into_inner);
        write_out(&format!("{:#}", Value::Object(results.clone())));
    }
}

fn write_out(text: &str) {
    let mut out = std::io::stdout().lock();
    if let Err(error) = writeln!(out, "{text}").and_then(|()| out.flush()) {
        if error.kind() == ErrorKind::BrokenPipe {
            std::process::exit(0);
        }
        let _ = writeln!(
            std::io::stderr().lock(),
            "error: writing to stdout: {error}"
        );
        std::process::exit(1);
    }
}

/// `message` in the JSON of protocol buffers, with the names of its .proto file and all fields.
pub fn message<M: Message + Name>(message: &M) -> Value {
    static POOL: OnceLock<Option<DescriptorPool>> = OnceLock::new();
    let pool = POOL.get_or_init(|| DescriptorPool::decode(yoto_proto::DESCRIPTORS).ok());
    let write = || {
        let kind = pool.as_ref()?.get_message_by_name(&M::full_name())?;
        let mut dynamic = DynamicMessage::new(kind);
        dynamic.transcode_from(message).ok()?;
        let options = SerializeOptions::new()
            .use_proto_field_name(true)
            .stringify_64_bit_integers(false)
            .skip_default_fields(false);
        let serializer = serde_json::value::Serializer;
        dynamic.serialize_with_options(serializer, &options).ok()
    };
    // The descriptors were compiled together with the messages; a test reads every kind.
    write().unwrap_or(Value::Null)
}

/// Paths of files.
pub fn paths<P: AsRef<Path>>(all: &[P]) -> Value {
    let text = |path: &P| Value::from(path.as_ref().display().to_string());
    all.iter().map(text).collect()
}

/// The JSON of each message.
pub fn messages<M: Message + Name>(all: &[M]) -> Value {
    all.iter().map(message).collect()
}

/// Prints a line of a result for people, as `println!` does.
#[macro_export]
macro_rules! say {
    ($($text:tt)*) => { $crate::output::line(format_args!($($text)*)) };
}

/// Prints a note for people on stderr, as `eprintln!` does.
#[macro_export]
macro_rules! tell {
    ($($text:tt)*) => { $crate::output::note(format_args!($($text)*)) };
}

/// Prints a note that only some people need, unless the style is brief.
#[macro_export]
macro_rules! detail {
    ($($text:tt)*) => { $crate::output::detail(format_args!($($text)*)) };
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_proto::v1::{
        Capture, Checkpoint, Job, JobSpec, Model, ServiceStatus, Subject, TrainSpec, job, job_spec,
    };

    #[test]
    fn messages_have_the_names_and_values_of_their_proto_file() {
        let job = Job {
            name: "jobs/1".into(),
            state: job::State::Running.into(),
            spec: Some(JobSpec {
                kind: Some(job_spec::Kind::Train(TrainSpec {
                    steps: 5_000_000_000,
                    ..TrainSpec::default()
                })),
            }),
            ..Job::default()
        };
        let json = message(&job);
        assert_eq!(json["name"], "jobs/1");
        assert_eq!(json["state"], "RUNNING");
        assert_eq!(json["spec"]["train"]["steps"], 5_000_000_000u64);
        assert_eq!(json["queue_position"], 0, "fields with defaults are there");
    }

    #[test]
    fn every_kind_of_result_is_known() {
        for json in [
            message(&Subject::default()),
            message(&Capture::default()),
            message(&Model::default()),
            message(&Checkpoint::default()),
            message(&ServiceStatus::default()),
        ] {
            assert!(json.is_object(), "{json}");
        }
    }
}
