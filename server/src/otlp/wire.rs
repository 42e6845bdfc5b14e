//! The connection to the collector.

use crate::config::{OtlpEndpoint, OtlpError};
use hyper_util::rt::TokioIo;
use rustls::crypto::ring::default_provider;
use rustls::pki_types::ServerName;
use rustls::{ClientConfig, RootCertStore};
use std::io;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpStream;
use tokio_rustls::TlsConnector;
use tokio_rustls::client::TlsStream;
use tonic::codegen::http::Uri;
use tonic::transport::{Channel, Endpoint};

/// Longest wait for the collector to accept a connection.
const ACCEPT: Duration = Duration::from_secs(5);
/// The port of `https://` without one.
const HTTPS_PORT: u16 = 443;

/// How to connect: channels to one collector.
#[derive(Clone)]
pub(crate) struct Wire {
    endpoint: Endpoint,
    tls: Option<Encrypted>,
}

/// TLS to a host.
#[derive(Clone)]
struct Encrypted {
    host: String,
    port: u16,
    connector: TlsConnector,
}

impl Wire {
    /// To the collector at `endpoint`. With `https://`, it is trusted if the system trusts its authority.
    ///
    /// # Errors
    /// When the address is invalid, or TLS can't be used.
    pub(crate) fn new(endpoint: &OtlpEndpoint) -> Result<Self, OtlpError> {
        let url = endpoint.url();
        let uri: Uri = match url.as_str().parse() {
            Ok(uri) => uri,
            Err(error) => return Err(OtlpError::Endpoint(format!("{error}"))),
        };
        let tls = match url.scheme() {
            "https" => Some(Encrypted {
                // The brackets of IPv6 belong to the URL.
                host: (url.host_str().unwrap_or_default())
                    .trim_matches(['[', ']'])
                    .to_owned(),
                port: url.port().unwrap_or(HTTPS_PORT),
                connector: connector()?,
            }),
            _ => None,
        };
        Ok(Self {
            endpoint: Endpoint::from(uri).connect_timeout(ACCEPT),
            tls,
        })
    }

    /// A channel that connects at its first call.
    pub(crate) fn channel(&self) -> Channel {
        match &self.tls {
            None => self.endpoint.connect_lazy(),
            Some(tls) => {
                let tls = tls.clone();
                let dial = tower::service_fn(move |_| tls.clone().dial());
                self.endpoint.connect_with_connector_lazy(dial)
            }
        }
    }
}

fn connector() -> Result<TlsConnector, rustls::Error> {
    let mut roots = RootCertStore::empty();
    // Those that can't be read or used are left out, as by other programs.
    roots.add_parsable_certificates(rustls_native_certs::load_native_certs().certs);
    let mut config = ClientConfig::builder_with_provider(Arc::new(default_provider()))
        .with_safe_default_protocol_versions()?
        .with_root_certificates(roots)
        .with_no_client_auth();
    config.alpn_protocols = vec![b"h2".to_vec()];
    Ok(TlsConnector::from(Arc::new(config)))
}

impl Encrypted {
    async fn dial(self) -> io::Result<TokioIo<TlsStream<TcpStream>>> {
        let connection = TcpStream::connect((self.host.as_str(), self.port)).await?;
        connection.set_nodelay(true)?;
        let name = ServerName::try_from(self.host).map_err(io::Error::other)?;
        let encrypted = self.connector.connect(name, connection).await?;
        Ok(TokioIo::new(encrypted))
    }
}
