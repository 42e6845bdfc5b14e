//! Why the store refuses or fails. A caller can repeat what failed for a time; a refusal stays.

use thiserror::Error;
use yoto_proto::names::Collection;
use yoto_proto::v1::ErrorReason;

/// An error of the store.
#[derive(Debug, Error)]
pub enum StoreError {
    /// The database is locked or can't be reached, or its disk is full. The same call may succeed later.
    #[error("{action}: {cause}")]
    Unavailable {
        /// The failed action.
        action: &'static str,
        /// The driver's error.
        cause: Box<dyn std::error::Error + Send + Sync>,
        /// Whether the database has rolled the transaction back for reasons of its own, so that the store runs it again.
        rolled_back: bool,
    },
    /// The database can't be used: the reason, and what to do.
    #[error("the database {0}")]
    Unusable(String),
    /// A row violates a constraint, because another call changed the database first.
    #[error("{action}: {cause}")]
    Conflict {
        /// The failed action.
        action: &'static str,
        /// The driver's error.
        cause: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The database is damaged, or a statement is invalid.
    #[error("{action}: {cause}")]
    Database {
        /// The failed action.
        action: &'static str,
        /// The driver's error.
        cause: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The database holds a value that this program can't read.
    #[error("{what} is unreadable in the database: {detail}")]
    Corrupt {
        /// The column.
        what: &'static str,
        /// The fault.
        detail: String,
    },
    /// No such resource.
    #[error("{name} does not exist")]
    NotFound {
        /// Its full name.
        name: String,
    },
    /// A number that the database can't hold.
    #[error("{field}: {value} is too large")]
    TooLarge {
        /// The field of the request.
        field: &'static str,
        /// Its value.
        value: u64,
    },
    /// The request id was used before with another body.
    #[error("request id '{request_id}' was used before with another body")]
    RequestIdReused {
        /// The id.
        request_id: String,
    },
    /// The fencing token is not the job's newest, or the job is no longer running.
    #[error(
        "token {token} has no lease on {job}: the job was leased again or is no longer running"
    )]
    StaleLease {
        /// The job's name.
        job: String,
        /// The token that was refused.
        token: u64,
    },
    /// The tenant may not use more.
    #[error(
        "the quota of {quota} is reached: {used} of {most} are used; `yoto usage` shows all, and the service's operator sets it \
         (`yoto quota`)"
    )]
    QuotaReached {
        /// The field of `yoto.v1.Quota`.
        quota: &'static str,
        /// What is used now.
        used: f64,
        /// What may be used.
        most: f64,
    },
    /// Not possible in the catalogue's current state.
    #[error("{message}")]
    Rule {
        /// Machine-readable.
        reason: ErrorReason,
        /// Human-readable.
        message: String,
    },
}

impl StoreError {
    /// A newer call writes to the upload with this id.
    pub fn taken_over(id: &str) -> Self {
        Self::Rule {
            reason: ErrorReason::UploadTakenOver,
            message: format!("another call goes on with {}", Collection::Uploads.name(id)),
        }
    }

    /// The upload with this id has ended.
    pub fn upload_finished(id: &str) -> Self {
        Self::Rule {
            reason: ErrorReason::UploadFinished,
            message: format!("{} is finished", Collection::Uploads.name(id)),
        }
    }

    /// The files of the capture with this id can't be read any more.
    pub fn upload_gone(id: &str) -> Self {
        Self::Rule {
            reason: ErrorReason::UploadGone,
            message: format!(
                "files of {} are no longer there: upload the capture again",
                Collection::Captures.name(id)
            ),
        }
    }

    /// Whether the database failed, as opposed to a refusal because of its content.
    pub fn is_failure(&self) -> bool {
        matches!(
            self,
            Self::Unavailable { .. } | Self::Conflict { .. } | Self::Database { .. }
        )
    }
}
