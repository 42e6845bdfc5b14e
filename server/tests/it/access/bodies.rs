//! Bodies of requests and answers end with the key: what comes afterwards is not committed, and the rest of a file is not sent, though
//! the connection stays open.

use crate::support::{Service, assert_refused, chunk, file, listen_as};
use std::future::Future;
use std::net::SocketAddr;
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::Code;
use yoto_proto::names;
use yoto_proto::v1::object_service_client::ObjectServiceClient;
use yoto_proto::v1::upload_service_client::UploadServiceClient;
use yoto_proto::v1::{DownloadObjectRequest, Scope};
use yoto_server::Admission;

/// Bytes of the file, and those that come before the revocation.
const BYTES: usize = 3 << 20;
const BEFORE: usize = 1 << 20;
/// Bytes of a file that does not fit into the buffers between service and client.
const LARGE: usize = 16 << 20;

/// An open upload of one file of [`BYTES`]. What has come is committed at once.
async fn upload(service: &Service) -> String {
    let subject = service.subject("Ada").await;
    let files = [file("poses.json", &vec![7; BYTES])];
    let upload = service.open_upload(&subject.name, &files).await;
    upload.expect("is opened").name
}

async fn committed(service: &Service, upload: &str) -> u64 {
    let upload = service.get_upload(upload).await.expect("is there");
    upload.committed_bytes
}

/// Waits until no more than the first bytes are committed for a while after all others were sent.
async fn nothing_more_comes(service: &Service, upload: &str) {
    tokio::time::sleep(Duration::from_millis(500)).await;
    let committed = committed(service, upload).await;
    assert!(committed <= BEFORE as u64, "{committed} bytes of {BYTES}");
}

#[tokio::test]
async fn a_stream_of_bytes_ends_with_its_key() {
    let service = Service::start().await;
    let key = service.key("default", &[Scope::Read, Scope::Write]).await;
    let upload = upload(&service).await;
    let (sender, receiver) = mpsc::channel(1);
    let mut uploads = UploadServiceClient::new(service.with_key(&key));
    let sent = ReceiverStream::new(receiver);
    let writing = tokio::spawn(async move { uploads.write_upload(sent).await });
    let bytes = vec![7; BEFORE];
    let send = async |from: usize| {
        let message = chunk(&upload, "poses.json", from as u64, &bytes);
        sender.send(message).await
    };
    send(0).await.expect("is sent");
    service.revoke(&key.name).await;
    // The call is over, and the client may go on sending: nobody takes it.
    let _ = send(BEFORE).await;
    let _ = send(2 * BEFORE).await;
    writing.await.expect("no panic").expect_err("is refused");
    nothing_more_comes(&service, &upload).await;
}

#[tokio::test]
async fn a_put_ends_with_its_key() {
    let service = Service::start().await;
    let key = service.key("default", &[Scope::Read, Scope::Write]).await;
    let upload = upload(&service).await;
    let (address, _serving) = listen_as(&service, Admission::Nobody).await;
    let mut connection = TcpStream::connect(address).await.expect("connects");
    let head = format!(
        "PUT /v1/{upload}/files/poses.json HTTP/1.1\r\nHost: {address}\r\nAuthorization: Bearer {}\r\nContent-Length: {BYTES}\r\n\r\n",
        key.text
    );
    connection.write_all(head.as_bytes()).await.expect("writes");
    let bytes = vec![7; BEFORE];
    connection.write_all(&bytes).await.expect("writes");
    tokio::time::sleep(Duration::from_millis(100)).await;
    service.revoke(&key.name).await;
    // The body ends some milliseconds later. The service may have closed its side then.
    tokio::time::sleep(Duration::from_millis(300)).await;
    let _ = connection.write_all(&bytes).await;
    let _ = connection.write_all(&bytes).await;
    let mut answer = [0; 12];
    let read = tokio::time::timeout(Duration::from_secs(20), connection.read_exact(&mut answer));
    read.await.expect("in time").expect("an answer");
    assert_eq!(&answer, b"HTTP/1.1 401");
    nothing_more_comes(&service, &upload).await;
}

/// A file of [`LARGE`] bytes; its resource name.
async fn large_file(service: &Service) -> String {
    let trained = service.trained().await;
    let published = (service)
        .publish_weights(&trained.training, 2, 25.0, &vec![7; LARGE])
        .await;
    names::object(
        &published.expect("is published").name,
        "weights.safetensors",
    )
}

#[tokio::test]
async fn a_download_ends_with_its_key() {
    let service = Service::start().await;
    let key = service.key("default", &[Scope::Read]).await;
    let file = large_file(&service).await;
    let mut objects = ObjectServiceClient::new(service.with_key(&key));
    let request = DownloadObjectRequest {
        name: file,
        ..DownloadObjectRequest::default()
    };
    let downloaded = objects.download_object(request).await;
    let mut chunks = downloaded.expect("begins").into_inner();
    let mut got = chunks
        .message()
        .await
        .expect("a chunk")
        .map_or(0, |it| it.chunk.len());
    service.revoke(&key.name).await;
    tokio::time::sleep(Duration::from_millis(300)).await;
    let end = loop {
        match chunks.message().await {
            Ok(Some(more)) => got += more.chunk.len(),
            Ok(None) => panic!("the whole file has come"),
            Err(status) => break status,
        }
    };
    assert_refused::<()>(Err(end), Code::Unauthenticated, "KEY_REVOKED");
    assert!(got < LARGE / 2, "{got} of {LARGE} bytes");
}

/// The bytes that come of an answer over HTTP with this request, if `revoke` is awaited after the first of them.
async fn cut_off(address: SocketAddr, request: &str, revoke: impl Future<Output = ()>) -> usize {
    let mut connection = TcpStream::connect(address).await.expect("connects");
    connection
        .write_all(request.as_bytes())
        .await
        .expect("writes");
    let mut first = vec![0; 64 << 10];
    connection.read_exact(&mut first).await.expect("begins");
    assert!(
        first.starts_with(b"HTTP/1.1 200"),
        "{:?}",
        String::from_utf8_lossy(&first[..100])
    );
    revoke.await;
    // Both sides have buffers, which are full by now.
    tokio::time::sleep(Duration::from_millis(1500)).await;
    let mut rest = Vec::new();
    // The service resets the connection, or ends it before the announced length.
    let read = tokio::time::timeout(Duration::from_secs(20), connection.read_to_end(&mut rest));
    let _ = read.await.expect("ends");
    first.len() + rest.len()
}

#[tokio::test]
async fn a_download_over_http_ends_with_its_key() {
    let service = Service::start().await;
    let key = service.key("default", &[Scope::Read]).await;
    let file = large_file(&service).await;
    let (address, _serving) = listen_as(&service, Admission::Nobody).await;
    let request = format!(
        "GET /v1/{file}:download HTTP/1.1\r\nHost: {address}\r\nAuthorization: Bearer {}\r\n\r\n",
        key.text
    );
    let got = cut_off(address, &request, service.revoke(&key.name)).await;
    assert!(got < LARGE, "{got} of {LARGE} bytes");
}
