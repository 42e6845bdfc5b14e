//! A request that can't be answered.

use crate::validation::FieldFaults;
use thiserror::Error;
use yoto_objects::ObjectsError;
use yoto_proto::v1::ErrorReason;
use yoto_store::StoreError;

/// A request that can't be answered. [`crate::status`] turns it into a gRPC status.
#[derive(Debug, Error)]
pub enum RequestError {
    /// No such resource.
    #[error("{name} does not exist")]
    NotFound {
        /// Its name.
        name: String,
    },
    /// Fields of the request are malformed.
    #[error("{0}")]
    Invalid(FieldFaults),
    /// The request is well-formed, but not possible in the current state.
    #[error("{message}")]
    Precondition {
        /// Machine-readable.
        reason: ErrorReason,
        /// Human-readable.
        message: String,
    },
    /// The caller may not call.
    #[error("{message}")]
    Refused {
        /// Machine-readable.
        reason: ErrorReason,
        /// Human-readable.
        message: String,
    },
    /// Several things are wrong with the request, or not possible now: at least two, of the other kinds.
    #[error("{}", listed(.0))]
    Several(Vec<RequestError>),
    /// A chunk of an upload was altered on its way.
    #[error(
        "{path}: the chunk at {offset} has the CRC-32C {found:08x}, not {told:08x} as was sent"
    )]
    CorruptChunk {
        /// The file.
        path: String,
        /// Offset of the chunk in the file, bytes.
        offset: u64,
        /// As sent.
        told: u32,
        /// As received.
        found: u32,
    },
    /// The disk is nearly full, or the limit of the store is nearly reached.
    #[error(
        "the store of the service has {free} bytes free, and {needed} are needed: `yoto gc` removes what \
         belongs to nothing, `yoto model checkpoints` and `yoto job list` show what can be deleted"
    )]
    DiskFull {
        /// Free bytes.
        free: u64,
        /// Bytes that must be free, including the announced ones.
        needed: u64,
    },
    /// A limit of traffic is reached; a later call may succeed.
    #[error("too much at once: {0}")]
    Busy(String),
    /// The audit log can't be written, so the call was not carried out.
    #[error("the audit log can't be written")]
    NotAudited,
    /// The coordinator is shutting down; a later call may succeed.
    #[error("the coordinator is shutting down")]
    ShuttingDown,
    /// The caller's own stream broke off.
    #[error("the request stream broke off: {0}")]
    Stream(tonic::Status),
    /// No layer has set the request's tenant.
    #[error("the request has no tenant")]
    NoTenant,
    /// The store.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The object store.
    #[error(transparent)]
    Objects(#[from] ObjectsError),
}

fn listed(errors: &[RequestError]) -> String {
    let texts: Vec<String> = errors.iter().map(ToString::to_string).collect();
    texts.join("; ")
}

impl RequestError {
    /// A malformed `field`.
    pub fn invalid(field: impl Into<String>, message: impl Into<String>) -> Self {
        Self::Invalid(FieldFaults::one(field.into(), message.into()))
    }

    /// Not possible now, because of `reason`.
    pub fn precondition(reason: ErrorReason, message: impl Into<String>) -> Self {
        Self::Precondition {
            reason,
            message: message.into(),
        }
    }

    /// The caller may not call, because of `reason`.
    pub fn refused(reason: ErrorReason, message: impl Into<String>) -> Self {
        Self::Refused {
            reason,
            message: message.into(),
        }
    }

    /// Whether it is a fault of the request, or of what it names, as opposed to one of the service: such faults are told
    /// together.
    pub fn is_fault(&self) -> bool {
        match self {
            Self::NotFound { .. }
            | Self::Invalid(_)
            | Self::Precondition { .. }
            | Self::Several(_) => true,
            Self::Store(error) => {
                matches!(error, StoreError::NotFound { .. } | StoreError::Rule { .. })
            }
            _ => false,
        }
    }

    /// A precondition failure because of this `field` of the request; empty: of no particular field.
    pub fn of(self, field: &str) -> Self {
        match self {
            Self::Precondition { reason, message } if !field.is_empty() => Self::Precondition {
                reason,
                message: format!("{field}: {message}"),
            },
            other => other,
        }
    }
}
