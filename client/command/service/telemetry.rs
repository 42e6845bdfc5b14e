//! Where `yoto serve` sends figures and traces.

use anyhow::Context;
use clap::Args;
use std::env::{VarError, var};
use yoto_server::{OtlpConfig, OtlpEndpoint};

/// The variable of headers. They are secret, so there is no option, which other users of the machine could see.
const HEADERS: &str = "OTEL_EXPORTER_OTLP_HEADERS";

/// Options of the push by OTLP.
#[derive(Debug, Args)]
pub(crate) struct TelemetryArgs {
    /// Collector of OpenTelemetry that gets the figures of /metrics, and a trace of each ended job, by OTLP over gRPC every 15
    /// seconds: http://HOST:4317 or https://HOST. Headers are in OTEL_EXPORTER_OTLP_HEADERS, NAME=VALUE with commas between
    /// them.
    #[arg(long, env = "OTEL_EXPORTER_OTLP_ENDPOINT", value_name = "URL")]
    otlp: Option<OtlpEndpoint>,
}

impl TelemetryArgs {
    /// Where to send, if anywhere.
    ///
    /// # Errors
    /// When the headers can't be used. Their values are not told.
    pub(crate) fn config(self) -> anyhow::Result<Option<OtlpConfig>> {
        let Some(endpoint) = self.otlp else {
            return Ok(None);
        };
        let text = match var(HEADERS) {
            Ok(text) => text,
            Err(VarError::NotPresent) => String::new(),
            Err(VarError::NotUnicode(_)) => anyhow::bail!("{HEADERS} is not UTF-8"),
        };
        let headers = text.parse().context(HEADERS)?;
        Ok(Some(OtlpConfig {
            headers,
            ..OtlpConfig::new(endpoint)
        }))
    }
}
