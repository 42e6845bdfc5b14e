//! Bodies of requests end with the key: what comes afterwards is not committed, though the connection stays open.

use crate::support::{Service, chunk, file, listen_as};
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use yoto_proto::v1::Scope;
use yoto_proto::v1::upload_service_client::UploadServiceClient;
use yoto_server::Admission;

/// Bytes of the file, and those that come before the revocation.
const BYTES: usize = 3 << 20;
const BEFORE: usize = 1 << 20;

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
