//! TLS between a client and a service: who is trusted, and a certificate that is replaced while the service runs.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tokio::net::{TcpListener, TcpStream};
use yoto_client::{Addresses, ClientError, YotoClient};
use yoto_proto::key::Key;
use yoto_proto::v1::CreateKeyRequest;
use yoto_server::{
    Admission, Certificates, Coordinator, KeyStore, ServerConfig, TlsError, TlsFiles,
};

/// Longest wait for something that has to happen, and the pause between two looks.
const PATIENCE: Duration = Duration::from_secs(60);
const PAUSE: Duration = Duration::from_millis(20);

/// A certificate of tests/tls, with its key.
fn pem(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/tls");
    folder.join(format!("{name}.pem"))
}

/// An encrypted service whose certificate is in a file of its folder.
struct Service {
    dir: TempDir,
    _coordinator: Coordinator,
    port: u16,
    key: Key,
}

impl Service {
    async fn start(clients: Option<PathBuf>) -> Self {
        let dir = TempDir::new().expect("a folder");
        let coordinator = Coordinator::open(ServerConfig::new(dir.path())).await;
        let coordinator = coordinator.expect("opens");
        let keys = KeyStore::in_folder(dir.path()).await.expect("opens");
        let request = CreateKeyRequest {
            display_name: "ada".into(),
            scopes: vec![1],
            ..CreateKeyRequest::default()
        };
        let made = keys.create(request).await.expect("is made");
        let file = dir.path().join("service.pem");
        std::fs::copy(pem("first"), &file).expect("copies");
        let certificates = Certificates::load(TlsFiles {
            certificate: file.clone(),
            key: file,
            client_authorities: clients,
        });
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("binds");
        let port = listener.local_addr().expect("has an address").port();
        let incoming = yoto_server::tls(listener, certificates.expect("are good"));
        let serving = coordinator.serve_to(Admission::Nobody, incoming, std::future::pending());
        tokio::spawn(serving);
        Self {
            dir,
            _coordinator: coordinator,
            port,
            key: made.secret.parse().expect("a key"),
        }
    }

    /// Calls by a new connection.
    async fn call(&self, ca: Option<&str>, own: Option<&str>) -> Result<(), ClientError> {
        let (ca, own) = (ca.map(pem), own.map(pem));
        let addresses = Addresses::parse(&format!("https://localhost:{}", self.port))?;
        let addresses = addresses.with_certificates(ca.as_deref(), own.as_deref())?;
        let channel = addresses.connect().await?;
        let client = YotoClient::with_key(channel, Some(self.key.clone()));
        client.status().await.map(drop)
    }

    /// What a probe without a key learns.
    async fn is_ready(&self) -> bool {
        let addresses = Addresses::parse(&format!("https://localhost:{}", self.port));
        let ca = pem("authority");
        let addresses = addresses.expect("good").with_certificates(Some(&ca), None);
        let channel = addresses.expect("good").connect().await.expect("connects");
        let client = YotoClient::new(channel);
        client.status().await.expect_err("asks for a key");
        client.is_ready().await.expect("answers")
    }

    /// The refusal of a new connection that has these `words`. The service looks at its files at most once a second.
    async fn refusal(&self, ca: Option<&str>, words: &str) {
        let began = Instant::now();
        loop {
            let outcome = self.call(ca, None).await;
            if let Err(refused) = &outcome {
                assert!(matches!(refused, ClientError::Tls(_)), "{refused:?}");
                let told = refused.to_string();
                assert_eq!(told.lines().count(), 1, "{told}");
                if told.contains(words) {
                    return;
                }
            }
            assert!(began.elapsed() < PATIENCE, "not {words}: {outcome:?}");
            tokio::time::sleep(PAUSE).await;
        }
    }

    /// Replaces the certificate.
    fn replace(&self, name: &str) {
        std::fs::copy(pem(name), self.dir.path().join("service.pem")).expect("copies");
    }
}

#[tokio::test]
async fn only_a_service_with_a_good_certificate_is_called() {
    let service = Service::start(None).await;
    service
        .call(Some("authority"), None)
        .await
        .expect("answers");
    assert!(service.is_ready().await, "health asks for no key");
    service.refusal(None, "--ca").await;
    service.replace("expired");
    service.refusal(Some("authority"), "has expired").await;
    service.replace("self_signed");
    service.refusal(Some("self_signed"), "CA:FALSE").await;
    service.replace("second");
    let began = Instant::now();
    while let Err(error) = service.call(Some("authority"), None).await {
        assert!(began.elapsed() < PATIENCE, "{error}");
        tokio::time::sleep(PAUSE).await;
    }
}

#[tokio::test]
async fn connections_without_a_handshake_keep_nobody_out() {
    let service = Service::start(None).await;
    let mut silent = Vec::new();
    // More than all places, from the address of the caller.
    for _ in 0..500 {
        let connected = TcpStream::connect(("127.0.0.1", service.port)).await;
        silent.push(connected.expect("connects"));
    }
    for _ in 0..3 {
        let called = service.call(Some("authority"), None).await;
        called.expect("answers");
    }
}

#[tokio::test]
async fn a_call_that_is_not_encrypted_is_told_of_https() {
    let service = Service::start(None).await;
    let addresses = Addresses::parse(&format!("http://localhost:{}", service.port));
    let channel = addresses.expect("good").connect().await.expect("connects");
    let refused = YotoClient::new(channel).status().await;
    let told = refused.expect_err("speaks TLS").to_string();
    assert!(told.contains("https://"), "{told}");
}

#[cfg(unix)]
#[tokio::test]
async fn a_new_certificate_that_can_not_be_used_leaves_the_earlier_one() {
    let service = Service::start(None).await;
    let file = service.dir.path().join("service.pem");
    std::fs::remove_file(&file).expect("is there");
    let made = std::process::Command::new("mkfifo").arg(&file).status();
    assert!(made.expect("runs").success());
    // A pipe takes the text once the service reads it.
    let torn = std::thread::spawn(move || std::fs::write(file, "-----BEGIN"));
    let began = Instant::now();
    while !torn.is_finished() {
        assert!(began.elapsed() < PATIENCE, "the file is not read again");
        let called = service.call(Some("authority"), None).await;
        called.expect("answers");
        tokio::time::sleep(PAUSE).await;
    }
    torn.join().expect("no panic").expect("is read");
    let called = service.call(Some("authority"), None).await;
    called.expect("answers");
}

#[tokio::test]
async fn a_client_without_the_certificate_that_is_asked_for_is_refused() {
    let service = Service::start(Some(pem("authority"))).await;
    let own = service.call(Some("authority"), Some("client")).await;
    own.expect("answers");
    let without = service.call(Some("authority"), None).await;
    without.expect_err("has none");
}

#[test]
fn a_key_of_another_certificate_is_told() {
    let load = |certificate: &str, key: PathBuf| {
        Certificates::load(TlsFiles {
            certificate: pem(certificate),
            key,
            client_authorities: None,
        })
    };
    let other = load("first", pem("second")).expect_err("is refused");
    assert!(matches!(other, TlsError::OtherKey { .. }), "{other}");
    let none = load("first", pem("authority")).expect_err("is refused");
    assert!(none.to_string().contains("authority.pem"), "{none}");
    load("first", PathBuf::from("no such file")).expect_err("is refused");
}
