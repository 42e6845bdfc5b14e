//! Logs: to stderr, filtered by `RUST_LOG`.

use std::io::IsTerminal;
use tracing_subscriber::EnvFilter;

/// Logs of a service.
#[cfg(feature = "embedded")]
#[derive(Debug, Clone, Copy, clap::Args)]
pub(crate) struct LogArgs {
    /// Format of logs: text for people, or JSON with one object per line.
    #[arg(
        long,
        value_enum,
        env = "YOTO_LOG_FORMAT",
        default_value = "text",
        value_name = "FORMAT"
    )]
    log_format: LogFormat,
    /// The earlier spelling of --log-format json.
    #[arg(long, hide = true)]
    log_json: bool,
}

/// A format of logs.
#[cfg(feature = "embedded")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum LogFormat {
    Text,
    Json,
}

#[cfg(feature = "embedded")]
impl LogArgs {
    /// Whether logs are JSON.
    pub(crate) fn are_json(self) -> bool {
        self.log_json || self.log_format == LogFormat::Json
    }
}

/// Starts logging at `default_level`, which `RUST_LOG` overrides.
pub(crate) fn init(default_level: &str, json: bool) {
    let filter =
        EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(default_level));
    let subscriber = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        // A log that can't be written must not end the program: the report of it would panic.
        .log_internal_errors(false)
        .with_ansi(std::io::stderr().is_terminal());
    // A second initialisation, as in a process that embeds the commands, keeps the first.
    let _ = if json {
        subscriber.json().try_init()
    } else {
        subscriber.try_init()
    };
}
