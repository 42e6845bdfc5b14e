//! The certificate of a service and its key, read from files again when these change.

use rustls::crypto::CryptoProvider;
use rustls::crypto::ring::default_provider;
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::server::WebPkiClientVerifier;
use rustls::{RootCertStore, ServerConfig};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant, SystemTime};
use thiserror::Error;

/// Interval of looks at the files.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// Files in PEM.
#[derive(Debug, Clone)]
pub struct TlsFiles {
    /// The service's certificate, and those between it and its authority.
    pub certificate: PathBuf,
    /// The certificate's private key.
    pub key: PathBuf,
    /// Authorities of clients: with them, a client needs a certificate too.
    pub client_authorities: Option<PathBuf>,
}

/// The reason why certificates can't be used.
#[derive(Debug, Error)]
pub enum TlsError {
    /// A file can't be read, or has no such content.
    #[error("{}: {told}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        told: String,
    },
    /// The key is of another certificate.
    #[error("the key in {} is not that of the certificate in {}", key.display(), certificate.display())]
    OtherKey {
        /// The key's file.
        key: PathBuf,
        /// The certificate's file.
        certificate: PathBuf,
    },
    /// They can't be used for another reason.
    #[error("TLS: {0}")]
    Unusable(String),
}

/// What tells whether a file has changed.
type Stamp = Option<(SystemTime, u64)>;

/// The certificates of a listener.
#[derive(Debug)]
pub struct Certificates {
    files: TlsFiles,
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    config: Arc<ServerConfig>,
    /// Of the files that were read last, whether or not they could be used.
    stamps: Vec<Stamp>,
    looked: Instant,
}

impl Certificates {
    /// Reads the files.
    ///
    /// # Errors
    /// When one can't be read, or the key is of another certificate.
    pub fn load(files: TlsFiles) -> Result<Self, TlsError> {
        // Stamps first: a change during the read is seen at the next look.
        let stamps = stamps(&files);
        let state = State {
            config: Arc::new(read(&files)?),
            stamps,
            looked: Instant::now(),
        };
        Ok(Self {
            files,
            state: Mutex::new(state),
        })
    }

    /// The settings for a connection that begins now. Files that have changed are read again; until all of them can be used
    /// together, the earlier ones stay.
    pub fn current(&self) -> Arc<ServerConfig> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        if state.looked.elapsed() < LOOK_EVERY {
            return Arc::clone(&state.config);
        }
        state.looked = Instant::now();
        self.look(&mut state);
        Arc::clone(&state.config)
    }

    fn look(&self, state: &mut State) {
        let stamps = stamps(&self.files);
        if stamps == state.stamps {
            return;
        }
        state.stamps = stamps;
        match read(&self.files) {
            Ok(config) => {
                tracing::info!(file = %self.files.certificate.display(), "the certificate was read again");
                state.config = Arc::new(config);
            }
            Err(error) => {
                tracing::error!(%error, "the new certificate can't be used: the earlier one stays");
            }
        }
    }
}

fn stamps(files: &TlsFiles) -> Vec<Stamp> {
    let stamp = |path: &PathBuf| {
        let meta = std::fs::metadata(path).ok()?;
        Some((meta.modified().ok()?, meta.len()))
    };
    let paths = [&files.certificate, &files.key].into_iter();
    paths.chain(&files.client_authorities).map(stamp).collect()
}

fn fault(path: &Path, told: impl ToString) -> TlsError {
    TlsError::File {
        path: path.to_owned(),
        told: told.to_string(),
    }
}

/// The certificates in a file, at least one.
fn certificates(path: &Path) -> Result<Vec<CertificateDer<'static>>, TlsError> {
    let all = CertificateDer::pem_file_iter(path).map_err(|error| fault(path, error))?;
    let all: Result<Vec<_>, _> = all.collect();
    let all = all.map_err(|error| fault(path, error))?;
    match all.is_empty() {
        true => Err(fault(path, "it has no certificate in PEM")),
        false => Ok(all),
    }
}

fn read(files: &TlsFiles) -> Result<ServerConfig, TlsError> {
    let unusable = |error: rustls::Error| TlsError::Unusable(error.to_string());
    let chain = certificates(&files.certificate)?;
    let key = PrivateKeyDer::from_pem_file(&files.key).map_err(|error| fault(&files.key, error))?;
    let provider: Arc<CryptoProvider> = Arc::new(default_provider());
    let builder = ServerConfig::builder_with_provider(Arc::clone(&provider))
        .with_safe_default_protocol_versions()
        .map_err(unusable)?;
    let builder = match &files.client_authorities {
        None => builder.with_no_client_auth(),
        Some(path) => {
            let mut roots = RootCertStore::empty();
            for authority in certificates(path)? {
                roots.add(authority).map_err(|error| fault(path, error))?;
            }
            let verifier = WebPkiClientVerifier::builder_with_provider(Arc::new(roots), provider);
            let verifier = verifier.build().map_err(|error| fault(path, error))?;
            builder.with_client_cert_verifier(verifier)
        }
    };
    let config = builder.with_single_cert(chain, key);
    let mut config = config.map_err(|error| match error {
        rustls::Error::InconsistentKeys(_) => TlsError::OtherKey {
            key: files.key.clone(),
            certificate: files.certificate.clone(),
        },
        other => unusable(other),
    })?;
    // gRPC, and the pages.
    config.alpn_protocols = vec![b"h2".to_vec(), b"http/1.1".to_vec()];
    Ok(config)
}
