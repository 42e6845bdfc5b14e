//! Requests of HTTP/1.1 as a browser sends them.

use super::Service;
use std::net::SocketAddr;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::task::JoinHandle;
use yoto_server::{Admission, ServerError, Tenant};

/// Serves on a port too.
pub(crate) async fn listen(service: &Service) -> (SocketAddr, JoinHandle<Result<(), ServerError>>) {
    listen_for(service, Tenant::default()).await
}

/// The same for the calls of `tenant`.
pub(crate) async fn listen_for(
    service: &Service,
    tenant: Tenant,
) -> (SocketAddr, JoinHandle<Result<(), ServerError>>) {
    listen_as(service, Admission::Process(tenant)).await
}

/// The same for those whom `admission` admits.
pub(crate) async fn listen_as(
    service: &Service,
    admission: Admission,
) -> (SocketAddr, JoinHandle<Result<(), ServerError>>) {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("binds");
    let address = listener.local_addr().expect("has an address");
    let incoming = yoto_server::tcp(listener);
    let serving = service
        .coordinator
        .serve_to(admission, incoming, std::future::pending());
    (address, tokio::spawn(serving))
}

/// Status, headers in lower case and body of the answer to a request.
pub(crate) async fn ask(address: SocketAddr, method: &str, path: &str) -> (u16, String, String) {
    ask_with(address, method, path, "", "").await
}

/// The same with more `headers`, each with its line end, and a body.
pub(crate) async fn ask_with(
    address: SocketAddr,
    method: &str,
    path: &str,
    headers: &str,
    body: &str,
) -> (u16, String, String) {
    let mut connection = TcpStream::connect(address).await.expect("connects");
    let length = match body.is_empty() {
        true => String::new(),
        false => format!("Content-Length: {}\r\n", body.len()),
    };
    let request = format!(
        "{method} {path} HTTP/1.1\r\nHost: {address}\r\n{headers}{length}Connection: close\r\n\r\n{body}"
    );
    let written = connection.write_all(request.as_bytes()).await;
    written.expect("writes");
    let mut answer = Vec::new();
    let read = connection.read_to_end(&mut answer).await;
    read.expect("reads");
    let answer = String::from_utf8_lossy(&answer);
    let (head, body) = answer.split_once("\r\n\r\n").expect("a head");
    let status = head.split(' ').nth(1).and_then(|it| it.parse().ok());
    let kept = head.lines().map(|line| match line.split_once(':') {
        Some((name, value)) => format!("{}:{value}\n", name.to_lowercase()),
        None => format!("{line}\n"),
    });
    let kept: String = kept.collect();
    let body = match kept.contains("transfer-encoding: chunked") {
        true => whole(body),
        false => body.to_owned(),
    };
    (status.expect("a status"), kept, body)
}

/// The body in `chunks`, each after its length.
fn whole(mut chunks: &str) -> String {
    let mut body = String::new();
    while let Some((length, rest)) = chunks.split_once("\r\n") {
        let length = usize::from_str_radix(length, 16).expect("a length");
        body += &rest[..length];
        chunks = rest[length..].trim_start_matches("\r\n");
    }
    body
}

/// An open answer that has no end.
pub(crate) struct Open {
    connection: TcpStream,
    text: String,
}

impl Open {
    pub(crate) async fn get(address: SocketAddr, path: &str, headers: &str) -> Self {
        let mut connection = TcpStream::connect(address).await.expect("connects");
        let request = format!("GET {path} HTTP/1.1\r\nHost: {address}\r\n{headers}\r\n");
        let written = connection.write_all(request.as_bytes()).await;
        written.expect("writes");
        Self {
            connection,
            text: String::new(),
        }
    }

    /// All that has come, up to and with the first event after the ones read before that contains `needle`.
    pub(crate) async fn until(&mut self, needle: &str) -> String {
        loop {
            if let Some(at) = self.text.find(needle)
                && let Some(end) = self.text[at..].find("\n\n")
            {
                let rest = self.text.split_off(at + end + 2);
                return std::mem::replace(&mut self.text, rest);
            }
            let mut buffer = [0; 4096];
            let read = self.connection.read(&mut buffer).await.expect("reads");
            assert!(read > 0, "it has ended after {}", self.text);
            self.text += &String::from_utf8_lossy(&buffer[..read]);
        }
    }

    /// Whether it ends.
    pub(crate) async fn ended(mut self) -> bool {
        let mut rest = Vec::new();
        self.connection.read_to_end(&mut rest).await.is_ok()
    }
}
