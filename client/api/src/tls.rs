//! TLS to a service: whom to trust, and the client's own certificate.

use super::ClientError;
use rustls::crypto::ring::default_provider;
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer, ServerName};
use rustls::{AlertDescription, CertificateError, ClientConfig, RootCertStore};
use std::io;
use std::path::Path;
use std::sync::Arc;
use thiserror::Error;
use tokio::net::TcpStream;
use tokio_rustls::TlsConnector;
use tokio_rustls::client::TlsStream;

/// How a client and an encrypted service prove who they are.
#[derive(Clone)]
pub(super) struct Tls(TlsConnector);

impl std::fmt::Debug for Tls {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Tls")
    }
}

/// The handshake has failed.
#[derive(Debug, Error)]
#[error("{0}")]
pub(super) struct TlsFault(String);

fn refused(path: &Path, told: impl ToString) -> ClientError {
    ClientError::Name(format!("{}: {}", path.display(), told.to_string()))
}

fn certificates(path: &Path) -> Result<Vec<CertificateDer<'static>>, ClientError> {
    let all = CertificateDer::pem_file_iter(path).map_err(|error| refused(path, error))?;
    let all: Result<Vec<_>, _> = all.collect();
    let all = all.map_err(|error| refused(path, error))?;
    match all.is_empty() {
        true => Err(refused(path, "it has no certificate in PEM")),
        false => Ok(all),
    }
}

/// Trusts the authorities of the system, for any protocol.
///
/// # Errors
/// When TLS can't be set up.
pub(super) fn system_config() -> Result<ClientConfig, ClientError> {
    config(None, None)
}

fn config(ca: Option<&Path>, own: Option<&Path>) -> Result<ClientConfig, ClientError> {
    let mut roots = RootCertStore::empty();
    match ca {
        Some(path) => {
            for authority in certificates(path)? {
                roots.add(authority).map_err(|error| refused(path, error))?;
            }
        }
        None => {
            // Those that can't be read or used are left out, as by other programs.
            roots.add_parsable_certificates(rustls_native_certs::load_native_certs().certs);
        }
    }
    let unusable = |error: rustls::Error| ClientError::Name(format!("TLS: {error}"));
    let builder = ClientConfig::builder_with_provider(Arc::new(default_provider()))
        .with_safe_default_protocol_versions()
        .map_err(unusable)?
        .with_root_certificates(roots);
    match own {
        None => Ok(builder.with_no_client_auth()),
        Some(path) => {
            let key = PrivateKeyDer::from_pem_file(path).map_err(|error| refused(path, error))?;
            let config = builder.with_client_auth_cert(certificates(path)?, key);
            config.map_err(|error| refused(path, error))
        }
    }
}

impl Tls {
    /// Trusts the authorities in the file `ca`, or those of the system without one; with the certificate and key in the file
    /// `own`, if the service asks for one.
    ///
    /// # Errors
    /// When a file can't be read or has no such content.
    pub(super) fn new(ca: Option<&Path>, own: Option<&Path>) -> Result<Self, ClientError> {
        let mut config = config(ca, own)?;
        config.alpn_protocols = vec![b"h2".to_vec()];
        Ok(Self(TlsConnector::from(Arc::new(config))))
    }

    /// Encrypts a connection to the host with this name.
    pub(super) async fn connect(
        self,
        host: &str,
        connection: TcpStream,
    ) -> io::Result<TlsStream<TcpStream>> {
        let name = ServerName::try_from(host.to_owned());
        let name = name.map_err(|error| io::Error::other(TlsFault(format!("{host}: {error}"))))?;
        let done = self.0.connect(name, connection).await;
        done.map_err(|error| {
            let cause = error.get_ref().and_then(|it| it.downcast_ref());
            match cause {
                Some(cause) => io::Error::other(TlsFault(told(host, cause))),
                None => error,
            }
        })
    }
}

/// A failed handshake with `host` in a line.
fn told(host: &str, error: &rustls::Error) -> String {
    use CertificateError as Bad;
    let why = match error {
        rustls::Error::InvalidCertificate(bad) => match bad {
            Bad::Expired | Bad::ExpiredContext { .. } => "it has expired".to_owned(),
            Bad::NotValidYet | Bad::NotValidYetContext { .. } => {
                "it is not valid yet: compare the clocks".to_owned()
            }
            Bad::UnknownIssuer => {
                "its authority is not trusted here: name the authority's certificate with --ca"
                    .to_owned()
            }
            Bad::NotValidForName | Bad::NotValidForNameContext { .. } => {
                "it was made for another name".to_owned()
            }
            // What `openssl req -x509` makes, unless it is told otherwise. The error has no type of rustls.
            Bad::Other(other) if format!("{other:?}").contains("CaUsedAsEndEntity") => {
                "it belongs to an authority, not to a server: make one with basicConstraints=CA:FALSE"
                    .to_owned()
            }
            other => other.to_string(),
        },
        rustls::Error::InvalidMessage(_) => {
            return format!("{host} does not speak TLS there: http:// instead of https://?");
        }
        rustls::Error::AlertReceived(AlertDescription::CertificateRequired) => {
            return format!("{host} asks for a certificate of the client: --client-cert");
        }
        other => return format!("{host}: {other}"),
    };
    format!("the certificate of {host} is refused: {why}")
}

/// The failed handshake among the causes of `error`.
pub(super) fn fault<'a>(error: &'a (dyn std::error::Error + 'static)) -> Option<&'a TlsFault> {
    let mut cause = Some(error);
    while let Some(error) = cause {
        if let Some(found) = error.downcast_ref() {
            return Some(found);
        }
        // `source` skips the error inside of an I/O error.
        let inner = error
            .downcast_ref::<io::Error>()
            .and_then(io::Error::get_ref);
        cause = match inner {
            Some(inner) => Some(inner as &(dyn std::error::Error + 'static)),
            None => error.source(),
        };
    }
    None
}
