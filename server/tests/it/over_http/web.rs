//! Calls by gRPC-Web, and pages of other sites.

use crate::support::{Service, ask_with, listen, listen_as};
use std::net::SocketAddr;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use yoto_proto::v1::Scope;
use yoto_server::Admission;

/// An empty message in a frame of gRPC.
const EMPTY: &str = "\0\0\0\0\0";
const KIND: &str = "Content-Type: application/grpc-web+proto\r\n";

/// Head and body of the answer to a call, as they come: a body in frames is no text, and its chunks are left as they are.
async fn call(address: SocketAddr, path: &str) -> (String, String) {
    let mut connection = TcpStream::connect(address).await.expect("connects");
    let request = format!(
        "POST {path} HTTP/1.1\r\nHost: {address}\r\n{KIND}Content-Length: 5\r\nConnection: close\r\n\r\n{EMPTY}"
    );
    let written = connection.write_all(request.as_bytes()).await;
    written.expect("writes");
    let mut answer = Vec::new();
    connection.read_to_end(&mut answer).await.expect("reads");
    let answer = String::from_utf8_lossy(&answer);
    let (head, body) = answer.split_once("\r\n\r\n").expect("a head");
    (head.to_lowercase(), body.to_owned())
}

#[tokio::test]
async fn a_script_calls_by_grpc_web_over_http_1() {
    let service = Service::start().await;
    service.model("duo").await;
    let (address, _serving) = listen(&service).await;
    let models = "/yoto.v1.ModelService/ListModels";
    let (head, body) = call(address, models).await;
    assert!(head.starts_with("http/1.1 200"), "{head}");
    assert!(
        head.contains("content-type: application/grpc-web+proto"),
        "{head}"
    );
    assert!(body.contains("duo"), "{body:?}");
    // The trailers are a frame of their own at the end.
    assert!(body.contains("grpc-status:0"), "{body:?}");
    let unknown = "/yoto.v1.ModelService/GetModel";
    let (head, body) = call(address, unknown).await;
    assert!(head.starts_with("http/1.1 200"), "{head}");
    assert!(
        format!("{head}{body}")
            .replace(": ", ":")
            .contains("grpc-status:3"),
        "{head}{body:?}"
    );
    let (status, ..) = ask_with(address, "GET", "/healthz", "", "").await;
    assert_eq!(status, 200, "other requests of HTTP/1 go by");
}

#[tokio::test]
async fn pages_of_allowed_sites_make_calls_with_a_key() {
    let site = "https://app.example.org";
    let service = Service::start_with(|config| config.allow_origins = vec![site.into()]).await;
    let key = service.key("default", &[Scope::Read]).await;
    let (address, _serving) = listen_as(&service, Admission::Machine).await;
    let asked = async |origin: &str, method: &str, more: &str| {
        let headers = format!("Origin: {origin}\r\n{more}");
        ask_with(address, method, "/v1/models", &headers, "").await
    };
    let before =
        "Access-Control-Request-Method: GET\r\nAccess-Control-Request-Headers: authorization\r\n";
    let (status, head, _) = asked(site, "OPTIONS", before).await;
    assert_eq!(status, 200, "{head}");
    assert!(
        head.contains(&format!("access-control-allow-origin: {site}")),
        "{head}"
    );
    assert!(head.contains("authorization"), "{head}");
    let with_key = format!("Authorization: Bearer {}\r\n", key.text);
    let (status, head, _) = asked(site, "GET", &with_key).await;
    assert_eq!(status, 200, "{head}");
    assert!(
        head.contains(&format!("access-control-allow-origin: {site}")),
        "{head}"
    );
    // Without a key nobody gets in, and no other site is told that it may read.
    let (status, ..) = asked(site, "GET", "").await;
    assert_eq!(status, 401);
    let (_, head, _) = asked("https://evil.example", "OPTIONS", before).await;
    assert!(!head.contains("access-control-allow-origin"), "{head}");
}
