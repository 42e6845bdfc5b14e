//! Downloads that nobody reads: each holds an open file.

use super::{door, with_key};
use crate::support::{Made, Service, ask_with, assert_refused};
use std::net::SocketAddr;
use tonic::{Code, Status, Streaming};
use yoto_proto::names;
use yoto_proto::v1::object_service_client::ObjectServiceClient;
use yoto_proto::v1::{DownloadObjectRequest, DownloadObjectResponse, Scope};

/// More than fits into the buffers between service and client.
const BYTES: usize = 16 << 20;

async fn download(
    address: SocketAddr,
    key: &Made,
    name: &str,
) -> Result<Streaming<DownloadObjectResponse>, Status> {
    let mut objects = ObjectServiceClient::new(with_key(address, key).await);
    let request = DownloadObjectRequest {
        name: name.into(),
        ..DownloadObjectRequest::default()
    };
    let downloaded = objects.download_object(request).await;
    downloaded.map(tonic::Response::into_inner)
}

#[tokio::test]
async fn downloads_that_nobody_reads_leave_some_to_others() {
    let service = Service::start_with(|config| config.traffic.downloads = 9).await;
    let trained = service.trained().await;
    let published = (service)
        .publish_weights(&trained.training, 2, 25.0, &vec![7; BYTES])
        .await;
    let file = names::object(
        &published.expect("is published").name,
        "weights.safetensors",
    );
    let greedy = service.key("default", &[Scope::Read]).await;
    let other = service.key("default", &[Scope::Read]).await;
    let address = door(&service).await;
    let mut open = Vec::new();
    loop {
        match download(address, &greedy, &file).await {
            Ok(stream) => open.push(stream),
            Err(status) => {
                break assert_refused::<()>(Err(status), Code::Unavailable, "BUSY");
            }
        }
    }
    assert_eq!(open.len(), 3, "a third");
    download(address, &other, &file).await.expect("another key");
    // Over HTTP too, which has the same share.
    let get = async |key: &Made| {
        let header = format!("Authorization: Bearer {}\r\n", key.text);
        let path = format!("/v1/{file}:download");
        ask_with(address, "GET", &path, &header, "").await.0
    };
    assert_eq!(get(&greedy).await, 503);
    assert_eq!(get(&other).await, 200);
    // Other calls are not downloads.
    super::lists(&with_key(address, &greedy).await)
        .await
        .expect("lists");
}
