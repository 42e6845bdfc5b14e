//! Browsers, and pages over plain HTTP: a page of another site calls nothing, and figures ask for a key.

use crate::support::{Open, Service, eventually};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use std::net::SocketAddr;
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tonic::Code;
use tonic::transport::{Channel, Endpoint};
use yoto_proto::v1::subject_service_client::SubjectServiceClient;
use yoto_proto::v1::{ListSubjectsRequest, Scope};
use yoto_server::Admission;

/// Serves on a port of this machine.
async fn listen(service: &Service) -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("binds");
    let address = listener.local_addr().expect("has an address");
    let incoming = yoto_server::tcp(listener);
    let serving =
        service
            .coordinator
            .serve_to(Admission::Machine, incoming, std::future::pending());
    tokio::spawn(serving);
    address
}

/// Status and text of the answer to a request with these headers.
async fn get(address: SocketAddr, path: &str, headers: &[&str]) -> (u16, String) {
    let mut connection = TcpStream::connect(address).await.expect("connects");
    let lines: String = headers.iter().map(|it| format!("{it}\r\n")).collect();
    let request = format!("GET {path} HTTP/1.1\r\nConnection: close\r\n{lines}\r\n");
    let written = connection.write_all(request.as_bytes()).await;
    written.expect("writes");
    let mut answer = String::new();
    connection.read_to_string(&mut answer).await.expect("reads");
    let status = answer.split(' ').nth(1).and_then(|it| it.parse().ok());
    (status.expect("a status"), answer)
}

/// The code of a call of gRPC that names the service so.
async fn call(address: SocketAddr, named: &str) -> Code {
    let endpoint = Endpoint::from_shared(format!("http://{address}")).expect("an address");
    let origin = format!("http://{named}").parse().expect("a URI");
    let channel: Channel = endpoint.origin(origin).connect().await.expect("connects");
    let listed = SubjectServiceClient::new(channel)
        .list_subjects(ListSubjectsRequest::default())
        .await;
    listed.map_or_else(|status| status.code(), |_| Code::Ok)
}

#[tokio::test]
async fn pages_of_other_sites_are_refused_where_no_key_is_asked_for() {
    let service = Service::start().await;
    let address = listen(&service).await;
    let own = format!("Host: {address}");
    assert_eq!(get(address, "/metrics", &[&own]).await.0, 200);
    for foreign in [
        &["Host: evil.example"][..],
        &[&own, "Origin: https://evil.example"],
        &[&own, "Sec-Fetch-Site: cross-site"],
        &[&own, "Origin: null"],
    ] {
        let (status, text) = get(address, "/metrics", foreign).await;
        assert_eq!(status, 403, "{foreign:?}: {text}");
    }
    // Probes learn one word, whoever asks.
    assert_eq!(
        get(address, "/readyz", &["Host: balancer.example"]).await.0,
        200
    );
    let port = address.port();
    assert_eq!(call(address, &format!("localhost:{port}")).await, Code::Ok);
    assert_eq!(
        call(address, &format!("evil.example:{port}")).await,
        Code::PermissionDenied
    );
}

#[tokio::test]
async fn figures_ask_for_an_operators_key_of_the_service() {
    let service = Service::start().await;
    let address = listen(&service).await;
    let operator = service.key("default", &[Scope::Operate]).await;
    let reader = service.key("default", &[Scope::Read]).await;
    let other = service.key("other", &[Scope::Operate]).await;
    let own = format!("Host: {address}");
    let with = |key: &str| format!("Authorization: Bearer {key}");
    let (status, text) = get(address, "/metrics", &[&own]).await;
    assert_eq!(status, 401);
    assert!(
        text.to_lowercase().contains("www-authenticate: bearer"),
        "{text}"
    );
    for key in [&reader, &other] {
        let (status, text) = get(address, "/metrics", &[&own, &with(&key.text)]).await;
        assert_eq!(status, 403, "{text}");
    }
    let wrong = get(address, "/metrics", &[&own, "Authorization: Basic eA=="]).await;
    assert_eq!(wrong.0, 401, "{}", wrong.1);
    // By a name that only a proxy knows, since the key says enough.
    let proxied = ["Host: yoto.example", &with(&operator.text)];
    assert_eq!(get(address, "/metrics", &proxied).await.0, 200);
    for open in ["/healthz", "/readyz"] {
        let answers = || async { (get(address, open, &[&own]).await.0 == 200).then_some(()) };
        eventually(open, answers).await;
    }
    assert_eq!(get(address, "/nothing", &[&own]).await.0, 404);
}

#[tokio::test]
async fn a_browser_signs_in_to_the_dashboard_with_a_key_as_the_password() {
    let service = Service::start().await;
    let address = listen(&service).await;
    let reader = service.key("default", &[Scope::Read]).await;
    let own = format!("Host: {address}");
    let (status, text) = get(address, "/people", &[&own]).await;
    assert_eq!(status, 401);
    assert!(
        text.to_lowercase().contains("www-authenticate: bearer") && text.contains("Sign in"),
        "{text}"
    );
    assert_eq!(get(address, "/assets/nothing", &[&own]).await.0, 404);
    let sent = |key: &str| {
        let user = STANDARD.encode(format!("ada:{key}"));
        format!("Authorization: Basic {user}")
    };
    let signed = sent(&reader.text);
    let (status, text) = get(address, "/people", &[&own, &signed]).await;
    assert_eq!(status, 200, "{text}");
    let bearer = format!("Authorization: Bearer {}", reader.text);
    assert_eq!(get(address, "/people", &[&own, &bearer]).await.0, 200);
    let wrong = sent(&reader.text.replace('_', "-"));
    assert_eq!(get(address, "/people", &[&own, &wrong]).await.0, 401);
    // A browser sends it for pages of other sites too, and only pages know passwords.
    let foreign = [&*own, &*signed, "Origin: https://evil.example"];
    assert_eq!(get(address, "/people", &foreign).await.0, 403);
    assert_eq!(get(address, "/metrics", &[&own, &signed]).await.0, 401);
    service.revoke(&reader.name).await;
    let out = || async {
        let answer = get(address, "/people", &[&own, &signed]).await;
        (answer.0 == 401).then_some(())
    };
    eventually("the end of the key", out).await;
}

#[tokio::test]
async fn the_events_of_a_page_end_with_the_key_of_its_reader() {
    let service = Service::start().await;
    let address = listen(&service).await;
    let reader = service.key("default", &[Scope::Read]).await;
    let bearer = format!(
        "Connection: close\r\nAuthorization: Bearer {}\r\n",
        reader.text
    );
    let mut reading = Open::get(address, "/events", &bearer).await;
    reading.until("event: hello").await;
    service.revoke(&reader.name).await;
    let ended = tokio::time::timeout(Duration::from_secs(20), reading.ended()).await;
    ended.expect("it ends");
}
