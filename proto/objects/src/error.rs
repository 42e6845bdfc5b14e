//! Failures of the object store.

use crate::class::{self, Class};
use std::error::Error;
use std::io::{self, ErrorKind};
use std::path::PathBuf;
use thiserror::Error;
use url::Url;

/// A failure of the object store.
#[derive(Debug, Error)]
pub enum ObjectsError {
    /// The URL names no supported store.
    #[error("the object store {url} can't be opened: {reason}")]
    Url {
        /// The URL, without credentials.
        url: Url,
        /// The fault.
        reason: String,
    },
    /// The store was tried, and something is wrong.
    #[error("the object store {url} can't be used: {reason}")]
    Unusable {
        /// The URL, without credentials.
        url: Url,
        /// What to do about it.
        reason: String,
    },
    /// The key is invalid.
    #[error("'{key}' is not an object key")]
    Key {
        /// The key.
        key: String,
        /// Why.
        #[source]
        cause: object_store::path::Error,
    },
    /// No object has this key.
    #[error("object '{key}' is missing")]
    Missing {
        /// The key.
        key: String,
    },
    /// The object has another size than in the catalogue.
    #[error("object '{key}' is torn: it has {found} bytes, not {expected}")]
    Size {
        /// The key.
        key: String,
        /// Size in the catalogue or the request.
        expected: u64,
        /// Size in the store.
        found: u64,
    },
    /// The object has the right size and other bytes than were written.
    #[error("object '{key}' is altered: its SHA-256 is {found}, not {expected}")]
    Altered {
        /// The key.
        key: String,
        /// Checksum in the catalogue.
        expected: String,
        /// Checksum of what was read.
        found: String,
    },
    /// The store failed.
    #[error("{action} object '{key}'")]
    Store {
        /// E.g. "writing".
        action: &'static str,
        /// The key.
        key: String,
        /// The store's error.
        #[source]
        cause: object_store::Error,
    },
    /// This machine's disk failed.
    #[error("{action} {}", path.display())]
    Disk {
        /// E.g. "writing".
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// The disk's error.
        #[source]
        cause: std::io::Error,
    },
}

impl ObjectsError {
    /// Whether the object is missing or differs from what was written, as opposed to a broken store: a
    /// retry is useless, and something older is needed.
    pub fn is_torn(&self) -> bool {
        match self {
            Self::Missing { .. } | Self::Size { .. } | Self::Altered { .. } | Self::Key { .. } => {
                true
            }
            Self::Url { .. } | Self::Unusable { .. } | Self::Store { .. } | Self::Disk { .. } => {
                false
            }
        }
    }

    /// Whether the store does not answer, or not now. The same call may succeed later.
    pub fn is_unavailable(&self) -> bool {
        self.class() == Some(Class::Unavailable)
    }

    /// Whether the store refuses this service, e.g. its credentials, until the operator changes something.
    pub fn is_refused(&self) -> bool {
        self.class() == Some(Class::Refused)
    }

    fn class(&self) -> Option<Class> {
        match self {
            Self::Store { cause, .. } => Some(class::of(cause)),
            _ => None,
        }
    }

    /// The error and its causes, in one line.
    pub fn with_causes(&self) -> String {
        class::text(self)
    }

    /// Whether a disk is full or a quota exceeded. The same write may succeed once there is room.
    pub fn is_full(&self) -> bool {
        let mut cause = Error::source(self);
        while let Some(error) = cause {
            if let Some(error) = error.downcast_ref::<io::Error>() {
                return matches!(
                    error.kind(),
                    ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::FileTooLarge
                );
            }
            cause = error.source();
        }
        false
    }

    pub(crate) fn url(url: &Url, reason: impl ToString) -> Self {
        let shown = crate::shown(url);
        // Errors of stores quote the URL.
        let reason = reason.to_string().replace(url.as_str(), shown.as_str());
        Self::Url { url: shown, reason }
    }

    pub(crate) fn of_store(action: &'static str, key: &str, cause: object_store::Error) -> Self {
        let key = key.to_owned();
        match class::of(&cause) {
            Class::Missing => Self::Missing { key },
            _ => Self::Store { action, key, cause },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_disk_is_found_in_the_sources_of_an_error() {
        let disk = |kind: ErrorKind| ObjectsError::Disk {
            action: "writing",
            path: PathBuf::from("a"),
            cause: kind.into(),
        };
        assert!(disk(ErrorKind::StorageFull).is_full());
        assert!(disk(ErrorKind::QuotaExceeded).is_full());
        assert!(!disk(ErrorKind::PermissionDenied).is_full());
        let cause = object_store::Error::Generic {
            store: "LocalFileSystem",
            source: Box::new(io::Error::from(ErrorKind::StorageFull)),
        };
        assert!(ObjectsError::of_store("writing", "a", cause).is_full());
    }
}
