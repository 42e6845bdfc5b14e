//! The requests of the script that sends a person's files: whom they answer, and what they can't do.

use super::forms::{field_in, token};
use crate::support::{Service, ask, ask_with, file, id, listen, listen_as, listen_for};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use std::net::SocketAddr;
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use yoto_proto::sha256_hex;
use yoto_proto::v1::{Scope, Upload, capture, subject};
use yoto_server::{Admission, Tenant};

const JSON: &str = "Content-Type: application/json\r\nSec-Fetch-Site: same-origin\r\n";

/// Headers of the script.
fn script(token: &str) -> String {
    format!("{JSON}x-yoto-token: {token}\r\n")
}

/// The sign-in of a browser.
fn signed_in(key: &str) -> String {
    let user = STANDARD.encode(format!("ada:{key}"));
    format!("Authorization: Basic {user}\r\n")
}

fn files(subject: &str) -> String {
    let listed = [("poses.json", "{}"), ("frames/000000.png", "pixels")].map(|(path, text)| {
        let sha256 = sha256_hex(text.as_bytes());
        let bytes = text.len();
        format!(r#"{{"path": "{path}", "bytes": {bytes}, "sha256": "{sha256}"}}"#)
    });
    format!(
        r#"{{"subject": "{subject}", "files": [{}]}}"#,
        listed.join(",")
    )
}

/// The resource name in an answer.
fn name(answer: &str) -> String {
    let rest = answer.split(r#""name":""#).nth(1).expect("a name");
    rest.split('"').next().unwrap_or_default().to_owned()
}

/// An upload of `Ada` that is open.
async fn open(service: &Service) -> (String, Upload) {
    let subject = service.subject("Ada").await.name;
    let files = ["poses.json", "a.png", "b.png"].map(|it| file(it, b"pixels"));
    let upload = service.open_upload(&subject, &files).await;
    (subject, upload.expect("is opened"))
}

/// All requests of the script for an upload and a person.
fn requests(upload: &str, subject: &str) -> Vec<(&'static str, String, String)> {
    let (upload, person) = (id(upload), id(subject));
    let path = |rest: String| format!("/people/upload/{rest}");
    vec![
        (
            "POST",
            path("person".into()),
            r#"{"display_name": "Eve"}"#.into(),
        ),
        ("POST", path("files".into()), files(subject)),
        ("GET", path(format!("files/{upload}")), String::new()),
        (
            "PUT",
            path(format!("files/{upload}/poses.json")),
            "{}".into(),
        ),
        ("POST", path(format!("finish/{upload}")), String::new()),
        ("POST", path(format!("cancel/{person}")), String::new()),
    ]
}

#[tokio::test]
async fn the_page_of_people_has_a_form_with_a_script_of_its_own() {
    let service = Service::start().await;
    let (address, serving) = listen(&service).await;
    let (_, head, page) = ask(address, "GET", "/people").await;
    assert!(
        head.contains("script-src 'self'; img-src") && !head.contains("unsafe"),
        "{head}"
    );
    assert_eq!(token(address, "/people").await.len(), 64);
    for shown in [
        "<noscript>",
        "yoto subject add",
        "yoto avatar",
        "type=\"file\"",
        "<details id=\"add\" open>",
    ] {
        assert!(page.contains(shown), "{shown}: {page}");
    }
    let script = page.split("type=\"module\" src=\"").nth(1);
    let script = script
        .and_then(|it| it.split('"').next())
        .expect("a script");
    let (status, head, text) = ask(address, "GET", script).await;
    assert_eq!(status, 200);
    assert!(head.contains("text/javascript"), "{head}");
    assert!(!text.contains("innerHTML") && !text.contains("://"));
    service.subject("Ada").await;
    let (_, _, page) = ask(address, "GET", "/people").await;
    assert!(page.contains("<details id=\"add\">"), "{page}");
    serving.abort();
}

#[tokio::test]
async fn somebody_who_is_signed_in_adds_a_person() {
    let service = Service::start().await;
    let key = service.key("default", &[Scope::Read, Scope::Write]).await;
    let (address, serving) = listen_as(&service, Admission::Nobody).await;
    let signed = signed_in(&key.text);
    let (_, _, page) = ask_with(address, "GET", "/people", &signed, "").await;
    let token = field_in(&page, "token");
    let headers = script(token) + &signed;
    let send = async |verb: &str, path: &str, more: &str, body: &str| {
        let path = format!("/people/upload/{path}");
        let (status, _, text) =
            ask_with(address, verb, &path, &(headers.clone() + more), body).await;
        (status, text)
    };
    let once = "Idempotency-Key: 1\r\n";
    let ada = r#"{"display_name": "Ada", "consent_note": "yes"}"#;
    let (status, person) = send("POST", "person", once, ada).await;
    assert_eq!(status, 200, "{person}");
    assert_eq!(
        send("POST", "person", once, ada).await,
        (200, person.clone())
    );
    let subject = name(&person);
    let (status, begun) = send("POST", "files", "", &files(&subject)).await;
    assert_eq!(status, 200, "{begun}");
    let upload = name(&begun);
    let part = format!("files/{}/frames%2F000000.png", id(&upload));
    let (status, told) = send("PUT", &part, "Content-Range: bytes 0-2/6\r\n", "pix").await;
    assert_eq!(status, 200, "{told}");
    // The page goes on where the service stands.
    let (_, state) = send(
        "GET",
        &format!("files/{}?stop_writer=true", id(&upload)),
        "",
        "",
    )
    .await;
    assert!(
        state.contains(r#"{"bytes":3,"path":"frames/000000.png"}"#),
        "{state}"
    );
    let (_, again) = send("PUT", &part, "Content-Range: bytes 0-2/6\r\n", "pix").await;
    assert!(again.contains("UPLOAD_OFFSET"), "{again}");
    send("PUT", &part, "Content-Range: bytes 3-5/6\r\n", "els").await;
    let finish = format!("finish/{}", id(&upload));
    let (status, missing) = send("POST", &finish, "", "").await;
    assert!(
        status == 400 && missing.contains("UPLOAD_INCOMPLETE"),
        "{missing}"
    );
    send(
        "PUT",
        &format!("files/{}/poses.json", id(&upload)),
        "",
        "{}",
    )
    .await;
    let (status, done) = send("POST", &finish, "", "").await;
    assert_eq!(status, 200, "{done}");
    let found = service.get_capture(&name(&done)).await;
    assert_eq!(found.state(), capture::State::Ingesting);
    assert_eq!(service.get_subject(&subject).await.consent_note, "yes");

    let (status, taken) = send("POST", "person", "", r#"{"display_name": " Ada"}"#).await;
    assert!(
        status == 409 && taken.contains("there is a person of this name already"),
        "{taken}"
    );
    // Whoever has a capture is not deleted from a page.
    let (status, kept) = send("POST", &format!("cancel/{}", id(&subject)), "", "").await;
    assert!(
        status == 409 && kept.contains("yoto subject delete"),
        "{kept}"
    );
    let (status, told) = send("POST", "person", "", r#"{"display_name": "a,b"}"#).await;
    assert!(
        status == 400 && told.contains(r#""field":"display_name""#),
        "{told}"
    );
    serving.abort();
}

#[tokio::test]
async fn a_request_without_the_token_of_the_page_changes_nothing() {
    let service = Service::start().await;
    let (subject, upload) = open(&service).await;
    let (address, serving) = listen_as(&service, Admission::Machine).await;
    let token = token(address, "/people").await;
    let good = format!("x-yoto-token: {token}\r\n");
    let foreign = format!("{good}Content-Type: application/json\r\nSec-Fetch-Site: cross-site\r\n");
    let other = format!("{}Origin: https://evil.example\r\n", script(&token));
    for (verb, path, body) in requests(&upload.name, &subject) {
        for headers in [JSON, &script(""), &script("0000"), &foreign, &other] {
            let (status, _, text) = ask_with(address, verb, &path, headers, &body).await;
            assert_eq!(status, 403, "{verb} {path} {headers}: {text}");
        }
    }
    let left = service.get_upload(&upload.name).await.expect("is there");
    assert_eq!(left.committed_bytes, 0);
    // The guard, and not something else, has refused them.
    let (verb, path, _) = &requests(&upload.name, &subject)[5];
    let (status, _, text) = ask_with(address, verb, path, &script(&token), "").await;
    assert_eq!(status, 200, "{text}");
    service.get_upload(&upload.name).await.expect_err("is gone");
    serving.abort();
}

#[tokio::test]
async fn a_key_without_write_or_of_another_tenant_can_send_nothing() {
    let service = Service::start().await;
    let (subject, upload) = open(&service).await;
    let reader = service.key("default", &[Scope::Read]).await;
    let writer = service.key("default", &[Scope::Read, Scope::Write]).await;
    let (address, serving) = listen_as(&service, Admission::Nobody).await;
    let signed = signed_in(&reader.text);
    let (_, _, page) = ask_with(address, "GET", "/people", &signed, "").await;
    let token = field_in(&page, "token");
    let headers = script(token);
    for (verb, path, body) in requests(&upload.name, &subject) {
        let (status, _, text) =
            ask_with(address, verb, &path, &(headers.clone() + &signed), &body).await;
        assert!(
            status == 403 && text.contains("scope write"),
            "{verb} {path}: {text}"
        );
        // The page tells it, and no browser asks for a key in the midst.
        let (status, head, _) = ask_with(address, verb, &path, &headers, &body).await;
        assert!(
            status == 401 && !head.contains("basic"),
            "{verb} {path}: {head}"
        );
        let evil = headers.clone() + &signed_in(&writer.text) + "Origin: https://evil.example\r\n";
        let (status, _, _) = ask_with(address, verb, &path, &evil, &body).await;
        assert_eq!(status, 403, "{verb} {path}");
    }
    // The calls themselves take no password still.
    let direct = headers + &signed_in(&writer.text);
    let (status, _, _) = ask_with(address, "POST", "/v1/uploads", &direct, &files(&subject)).await;
    assert_eq!(status, 401);
    serving.abort();

    let other = Tenant::new("other").expect("an id");
    let (address, serving) = listen_for(&service, other).await;
    let own = super::forms::token(address, "/people").await;
    for (verb, path, body) in requests(&upload.name, &subject).into_iter().skip(1) {
        let (status, _, text) = ask_with(address, verb, &path, &script(&own), &body).await;
        assert_eq!(status, 404, "{verb} {path}: {text}");
    }
    assert_eq!(
        service.get_subject(&subject).await.state(),
        subject::State::Uploading
    );
    serving.abort();
}

/// What the service sends next.
async fn arrived(connection: &mut TcpStream) -> String {
    let mut bytes = vec![0; 4096];
    let read = tokio::time::timeout(Duration::from_secs(20), connection.read(&mut bytes));
    let read = read.await.expect("is answered").expect("reads");
    String::from_utf8_lossy(&bytes[..read]).into_owned()
}

/// The status of the answer to a PUT whose body never ends, once its key has.
async fn cut_short(
    address: SocketAddr,
    service: &Service,
    path: &str,
    headers: &str,
    key: &str,
) -> u16 {
    let mut connection = TcpStream::connect(address).await.expect("connects");
    let head = format!(
        "PUT {path} HTTP/1.1\r\nHost: {address}\r\nContent-Length: 6\r\nExpect: 100-continue\r\n{headers}\r\n"
    );
    connection.write_all(head.as_bytes()).await.expect("writes");
    // The service says so when it begins to read the body.
    let begun = arrived(&mut connection).await;
    assert_eq!(begun, "HTTP/1.1 100 Continue\r\n\r\n");
    connection.write_all(b"pix").await.expect("writes");
    service.revoke(key).await;
    let answer = arrived(&mut connection).await;
    let status = answer.split(' ').nth(1).and_then(|it| it.parse().ok());
    status.unwrap_or_else(|| panic!("{answer}"))
}

#[tokio::test]
async fn a_file_ends_with_the_key_of_its_sender() {
    let service = Service::start().await;
    let (_, upload) = open(&service).await;
    let (address, serving) = listen_as(&service, Admission::Nobody).await;
    let key = async || service.key("default", &[Scope::Read, Scope::Write]).await;
    let one = key().await;
    let bearer = format!("Authorization: Bearer {}\r\n", one.text);
    let path = format!("/v1/{}/files/a.png", upload.name);
    assert_eq!(
        cut_short(address, &service, &path, &bearer, &one.name).await,
        401
    );
    let two = key().await;
    let signed = signed_in(&two.text);
    let (_, _, page) = ask_with(address, "GET", "/people", &signed, "").await;
    let token = field_in(&page, "token");
    let headers = script(token) + &signed;
    let path = format!("/people/upload/files/{}/b.png", id(&upload.name));
    assert_eq!(
        cut_short(address, &service, &path, &headers, &two.name).await,
        401
    );
    serving.abort();
}
