//! The server's process-wide parts: its thread, its connections, and who may do what.

use crate::fault::{Faults, S3Fault};
use crate::{AUTHORITY, BUCKET};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::TokioIo;
use rustls::ServerConfig;
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use s3s::access::{S3Access, S3AccessContext};
use s3s::auth::SimpleAuth;
use s3s::config::{S3Config, StaticConfigProvider};
use s3s::service::{S3Service, S3ServiceBuilder};
use s3s::{S3Result, s3_error};
use s3s_fs::FileSystem;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use tempfile::TempDir;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpListener;
use tokio_rustls::TlsAcceptor;

/// The only key.
const KEY: &str = "YOTOTESTKEY";
/// Its secret.
const SECRET: &str = "yoto-test-secret";
/// The server's certificate and its key.
const CERTIFICATE: &str = include_str!("../certificate/server.pem");

/// How a server is to be.
#[derive(Debug, Clone, Copy, Default)]
pub struct Setup {
    /// Speaks TLS, with a certificate that [`AUTHORITY`] has signed.
    pub tls: bool,
    /// Takes no difference between clocks, so that each request has one.
    pub no_skew: bool,
}

/// A running server, which ends with this value.
#[derive(Debug)]
pub struct Server {
    address: SocketAddr,
    tls: bool,
    root: TempDir,
    shared: Arc<Shared>,
    runtime: Option<tokio::runtime::Runtime>,
}

#[derive(Debug, Default)]
struct Shared {
    faults: Faults,
    denied: Mutex<Vec<&'static str>>,
}

impl Server {
    /// Starts a server with the [`BUCKET`].
    ///
    /// # Panics
    /// When it can't start.
    pub fn start() -> Self {
        Self::start_with(Setup::default())
    }

    /// Starts a server with a setup.
    ///
    /// # Panics
    /// When it can't start.
    pub fn start_with(setup: Setup) -> Self {
        let root = tempfile::tempdir().expect("a folder");
        std::fs::create_dir(root.path().join(BUCKET)).expect("a bucket");
        let shared = Arc::new(Shared::default());
        let service = service(root.path(), Arc::clone(&shared), setup);
        // Its own, so that it also serves tests that block.
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .enable_all()
            .build()
            .expect("a runtime");
        let listener = std::net::TcpListener::bind(("127.0.0.1", 0)).expect("a port");
        let address = listener.local_addr().expect("an address");
        listener.set_nonblocking(true).expect("can wait");
        let tls = setup.tls.then(acceptor);
        runtime.spawn(accept(listener, tls, service, Arc::clone(&shared)));
        Self {
            address,
            tls: setup.tls,
            root,
            shared,
            runtime: Some(runtime),
        }
    }

    /// The variables by which a program finds it.
    pub fn environment(&self) -> Vec<(String, String)> {
        let scheme = if self.tls { "https" } else { "http" };
        let variables = [
            ("AWS_ACCESS_KEY_ID", KEY.to_owned()),
            ("AWS_SECRET_ACCESS_KEY", SECRET.to_owned()),
            ("AWS_ENDPOINT_URL", format!("{scheme}://{}", self.address)),
            ("AWS_REGION", "us-east-1".to_owned()),
            ("AWS_ALLOW_HTTP", "true".to_owned()),
        ];
        variables
            .map(|(name, value)| (name.to_owned(), value))
            .into()
    }

    /// The environment with one variable changed.
    pub fn environment_with(&self, name: &str, value: &str) -> Vec<(String, String)> {
        let mut all = self.environment();
        all.retain(|(known, _)| known != name);
        all.push((name.to_owned(), value.to_owned()));
        all
    }

    /// The environment of a program that knows the authority of its certificate.
    pub fn environment_with_authority(&self) -> Vec<(String, String)> {
        self.environment_with("AWS_CA_BUNDLE", AUTHORITY)
    }

    /// The folder with the objects of the bucket, each in a file with its key.
    pub fn folder(&self) -> PathBuf {
        self.root.path().join(BUCKET)
    }

    /// Has all requests fail until [`Self::heal`].
    pub fn fail(&self, fault: S3Fault) {
        self.shared.faults.set(Some(fault));
    }

    /// Ends a failure.
    pub fn heal(&self) {
        self.shared.faults.set(None);
    }

    /// Requests that failed by a fault.
    pub fn failed(&self) -> u64 {
        self.shared.faults.failed()
    }

    /// Requests that came by signed URLs.
    pub fn signed(&self) -> u64 {
        self.shared.faults.signed()
    }

    /// Denies operations by their names in S3, e.g. `DeleteObjects`, and allows all others.
    pub fn deny(&self, operations: &[&'static str]) {
        *self
            .shared
            .denied
            .lock()
            .unwrap_or_else(PoisonError::into_inner) = operations.to_vec();
    }

    /// Uploads in parts that are neither complete nor aborted.
    ///
    /// # Panics
    /// When the folder can't be read.
    pub fn open_uploads(&self) -> usize {
        let entries = std::fs::read_dir(self.root.path()).expect("lists");
        let names = entries.map(|it| it.expect("an entry").file_name());
        names
            .filter(|it| it.to_string_lossy().starts_with(".upload-"))
            .count()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }
}

fn service(root: &std::path::Path, shared: Arc<Shared>, setup: Setup) -> S3Service {
    let files = FileSystem::new(root).expect("a folder of objects");
    let mut builder = S3ServiceBuilder::new(files);
    builder.set_auth(SimpleAuth::from_single(KEY, SECRET));
    builder.set_access(Access(shared));
    if setup.no_skew {
        let mut config = S3Config::default();
        config.presigned_url_max_skew_time_secs = 0;
        builder.set_config(Arc::new(StaticConfigProvider::new(Arc::new(config))));
    }
    builder.build()
}

/// Takes connections until the runtime ends.
async fn accept(
    listener: std::net::TcpListener,
    tls: Option<TlsAcceptor>,
    service: S3Service,
    shared: Arc<Shared>,
) {
    let listener = TcpListener::from_std(listener).expect("a listener");
    while let Ok((socket, _)) = listener.accept().await {
        let (tls, service, shared) = (tls.clone(), service.clone(), Arc::clone(&shared));
        tokio::spawn(async move {
            match tls {
                None => serve(socket, service, shared).await,
                // A client that does not trust the certificate ends the connection.
                Some(tls) => {
                    if let Ok(socket) = tls.accept(socket).await {
                        serve(socket, service, shared).await;
                    }
                }
            }
        });
    }
}

async fn serve(
    socket: impl AsyncRead + AsyncWrite + Unpin + Send + 'static,
    service: S3Service,
    shared: Arc<Shared>,
) {
    let answer = service_fn(move |request| {
        let (service, shared) = (service.clone(), Arc::clone(&shared));
        async move { shared.faults.answer(&service, request).await }
    });
    // It fails by design, or since the client has gone.
    let _ = http1::Builder::new()
        .serve_connection(TokioIo::new(socket), answer)
        .await;
}

fn acceptor() -> TlsAcceptor {
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let chain = CertificateDer::pem_slice_iter(CERTIFICATE.as_bytes());
    let chain = chain.collect::<Result<_, _>>().expect("certificates");
    let key = PrivateKeyDer::from_pem_slice(CERTIFICATE.as_bytes()).expect("a key");
    let config = ServerConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .expect("versions of TLS")
        .with_no_client_auth()
        .with_single_cert(chain, key)
        .expect("belong together");
    TlsAcceptor::from(Arc::new(config))
}

/// Allows the key all operations that are not denied.
struct Access(Arc<Shared>);

#[async_trait::async_trait]
impl S3Access for Access {
    async fn check(&self, context: &mut S3AccessContext<'_>) -> S3Result<()> {
        let denied = self.0.denied.lock().unwrap_or_else(PoisonError::into_inner);
        let denied = denied.contains(&context.s3_op().name());
        match context.credentials() {
            // The server would make it.
            Some(_) if context.s3_path().get_bucket_name() != Some(BUCKET) => {
                Err(s3_error!(NoSuchBucket))
            }
            Some(_) if !denied => Ok(()),
            _ => Err(s3_error!(AccessDenied, "denied by the test")),
        }
    }
}
