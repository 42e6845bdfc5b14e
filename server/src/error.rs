//! Errors of the coordinator while it opens or serves.

use crate::config::{ConfigError, OtlpError};
use std::path::PathBuf;
use thiserror::Error;
use yoto_objects::ObjectsError;
use yoto_store::StoreError;
use yoto_store::binding::BindingError;

/// The coordinator can't open or serve.
#[derive(Debug, Error)]
pub enum ServerError {
    /// Another process owns the data folder.
    #[error(
        "the data folder {} is in use by another coordinator; stop it, or choose another folder",
        path.display()
    )]
    DataDirInUse {
        /// The folder.
        path: PathBuf,
    },
    /// The data folder can't be used.
    #[error("data folder {}: {cause}", path.display())]
    DataDir {
        /// The folder or a file in it.
        path: PathBuf,
        /// Why.
        cause: std::io::Error,
    },
    /// The configuration is invalid.
    #[error("configuration: {0}")]
    Config(String),
    /// The database can't be opened.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The object store can't be opened.
    #[error(transparent)]
    Objects(#[from] ObjectsError),
    /// Database and object store don't belong together.
    #[error(transparent)]
    Binding(Box<BindingError>),
    /// There is no database to open.
    #[error("there is no service's database at {}: name its data folder with --data", .0.display())]
    NoDatabase(PathBuf),
    /// Figures and traces can't be sent.
    #[error(transparent)]
    Otlp(#[from] OtlpError),
    /// A key can't be made or found.
    #[error("{0}")]
    Key(String),
    /// The gRPC transport failed.
    #[error("serving gRPC")]
    Transport(#[from] tonic::transport::Error),
    /// The reflection service could not be made.
    #[error("gRPC reflection")]
    Reflection(#[from] tonic_reflection::server::Error),
}

impl From<BindingError> for ServerError {
    fn from(error: BindingError) -> Self {
        Self::Binding(Box::new(error))
    }
}

impl From<ConfigError> for ServerError {
    fn from(error: ConfigError) -> Self {
        Self::Config(error.0)
    }
}
