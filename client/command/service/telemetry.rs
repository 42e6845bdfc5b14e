//! Where `yoto serve` sends figures and traces.

use anyhow::Context;
use clap::Args;
use std::env::{VarError, var};
use std::str::FromStr;
use yoto_server::{OtlpConfig, OtlpEndpoint, OtlpError};

/// The variable of headers. They are secret, so there is no option, which other users of the machine could see.
const HEADERS: &str = "OTEL_EXPORTER_OTLP_HEADERS";

/// Options of the push by OTLP.
#[derive(Debug, Args)]
pub(crate) struct TelemetryArgs {
    /// OpenTelemetry collector, http://HOST:4317 or https://HOST. Every 15 seconds it gets the figures of /metrics,
    /// and a trace of each job that has ended, by OTLP over gRPC. Headers come from OTEL_EXPORTER_OTLP_HEADERS:
    /// NAME=VALUE, separated by commas.
    #[arg(long, env = "OTEL_EXPORTER_OTLP_ENDPOINT", value_name = "URL")]
    otlp: Option<Collector>,
}

impl TelemetryArgs {
    /// Where to send, if anywhere.
    ///
    /// # Errors
    /// When the headers can't be used. Their values are not told.
    pub(crate) fn config(self) -> anyhow::Result<Option<OtlpConfig>> {
        let Some(Collector(Some(endpoint))) = self.otlp else {
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

/// A collector. An empty text means no collector, as OpenTelemetry specifies for its variables.
#[derive(Debug, Clone)]
struct Collector(Option<OtlpEndpoint>);

impl FromStr for Collector {
    type Err = OtlpError;

    fn from_str(text: &str) -> Result<Self, OtlpError> {
        match text {
            "" => Ok(Self(None)),
            text => text.parse().map(|endpoint| Self(Some(endpoint))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_empty_variable_counts_as_unset() {
        let Collector(endpoint) = "".parse().expect("parses");
        assert_eq!(endpoint, None);
        let Collector(endpoint) = "http://collector:4317".parse().expect("parses");
        assert!(endpoint.is_some());
        "collector:4317"
            .parse::<Collector>()
            .expect_err("has no scheme");
    }
}
