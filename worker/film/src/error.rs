//! Why a render can't be planned.

use std::error::Error;
use yoto_proto::pose_track::{describe, violation};
use yoto_proto::v1::Violation;

/// The reason why a render can't be planned.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// The request is at fault. Never empty.
    #[error("{}", lines(.0))]
    Invalid(Vec<Violation>),
    /// Anything else.
    #[error("{message}")]
    Failed {
        /// For programs, e.g. `INTERNAL`, `NO_CHECKPOINT`, `RETARGET`.
        code: &'static str,
        /// Human-readable, with the causes.
        message: String,
    },
}

impl PlanError {
    /// One `field` of the request is at fault.
    pub(crate) fn invalid(field: &str, message: impl Into<String>) -> Self {
        Self::Invalid(vec![violation("INVALID", "render", None, field, message)])
    }

    /// A failure from an error with all its causes, and the failed action.
    pub(crate) fn failed(code: &'static str, doing: &str, error: &dyn Error) -> Self {
        let mut message = format!("{doing}: {error}");
        let mut cause = error.source();
        while let Some(error) = cause {
            message += &format!(": {error}");
            cause = error.source();
        }
        Self::Failed { code, message }
    }

    /// A contradiction between what the caller was told to fetch and what the plan reads.
    pub(crate) fn internal(message: String) -> Self {
        let code = "INTERNAL";
        Self::Failed { code, message }
    }
}

fn lines(violations: &[Violation]) -> String {
    let lines: Vec<String> = violations.iter().map(describe).collect();
    lines.join("; ")
}
