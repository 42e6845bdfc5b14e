//! An upload beside an earlier stream of the same program, which the service gets although its connection counts as lost.

use prost::Message;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use tokio::net::TcpListener;
use yoto_client::{ClientError, FileSource, UploadFile, YotoClient};
use yoto_proto::crc32c;
use yoto_proto::v1::upload_service_client::UploadServiceClient;
use yoto_proto::v1::{
    Capture, CreateUploadRequest, FileHeader, GetUploadRequest, WriteUploadRequest, capture,
};
use yoto_server::{Coordinator, ServerConfig};

/// Bytes that are committed at once.
const PART: usize = 1024;
/// Bytes of the only file.
const BYTES: usize = 500 * PART;

async fn serve(folder: &Path) -> String {
    let mut config = ServerConfig::new(folder);
    config.storage.min_free_bytes = 0;
    config.upload.part_bytes = PART as u64;
    let coordinator = Coordinator::open(config).await.expect("opens");
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("binds");
    let address = listener.local_addr().expect("has an address");
    let incoming = yoto_server::tcp(listener);
    tokio::spawn(async move {
        coordinator
            .serve(incoming, std::future::pending())
            .await
            .expect("serves");
    });
    format!("http://{address}")
}

/// The earlier stream.
#[derive(Clone)]
struct Earlier {
    address: String,
    subject: String,
    upload: String,
    content: Vec<u8>,
}

impl Earlier {
    /// The open upload of a file of one subject, whose first part is committed.
    async fn begin(address: &str) -> Self {
        let client = YotoClient::connect(address).await.expect("connects");
        let subject = client.create_subject("Ada", "").await.expect("creates");
        let content: Vec<u8> = (0..BYTES).map(|at| (at % 251) as u8).collect();
        let mut request = CreateUploadRequest {
            subject: subject.name.clone(),
            files: vec![FileHeader {
                path: "poses.json".into(),
                bytes: BYTES as u64,
                sha256: yoto_proto::sha256_hex(&content),
            }],
            request_id: String::new(),
            validate_only: false,
        };
        request.request_id = yoto_proto::sha256_hex(&request.encode_to_vec());
        let mut earlier = Self {
            address: address.to_owned(),
            subject: subject.name,
            upload: String::new(),
            content,
        };
        let created = earlier.service().await.create_upload(request).await;
        earlier.upload = created.expect("creates").into_inner().name;
        earlier.write(0).await;
        earlier
    }

    async fn service(&self) -> UploadServiceClient<tonic::transport::Channel> {
        let service = UploadServiceClient::connect(self.address.clone()).await;
        service.expect("connects")
    }

    /// Writes part `number`.
    async fn write(&self, number: usize) {
        let chunk = self.content[number * PART..(number + 1) * PART].to_vec();
        let message = WriteUploadRequest {
            upload: self.upload.clone(),
            path: "poses.json".into(),
            offset: (number * PART) as u64,
            crc32c: crc32c(&chunk),
            chunk: chunk.into(),
        };
        let stream = tokio_stream::once(message);
        let answer = self.service().await.write_upload(stream).await;
        answer.expect("commits");
    }

    /// How far the upload is; with `stop_writer`, once it is taken over.
    async fn committed(&self, stop_writer: bool) -> u64 {
        let request = GetUploadRequest {
            name: self.upload.clone(),
            stop_writer,
        };
        let answer = self.service().await.get_upload(request).await;
        answer.expect("answers").into_inner().committed_bytes
    }

    /// Uploads the file while `happens` is done after each report of its progress.
    async fn upload_beside(&self, happens: impl AsyncFn(u64)) -> Result<Capture, ClientError> {
        let client = YotoClient::connect(&self.address).await.expect("connects");
        let file = UploadFile {
            path: "poses.json".into(),
            source: FileSource::Memory(self.content.clone()),
        };
        let here = tokio::runtime::Handle::current();
        let beside = |bytes| tokio::task::block_in_place(|| here.block_on(happens(bytes)));
        client
            .upload_capture(&self.subject, vec![file], beside)
            .await
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn an_earlier_stream_that_arrives_late_costs_a_question() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let address = serve(folder.path()).await;
    let earlier = Earlier::begin(&address).await;
    let (begun, taken) = (AtomicBool::new(false), AtomicBool::new(false));
    let uploaded = earlier
        .upload_beside(async |_| {
            if !begun.swap(true, Ordering::Relaxed) {
                // Before the new stream begins.
                earlier.write(1).await;
            } else if !taken.load(Ordering::Relaxed)
                && earlier.committed(false).await > 2 * PART as u64
            {
                // While it goes on.
                earlier.committed(true).await;
                taken.store(true, Ordering::Relaxed);
            }
        })
        .await
        .expect("goes on");
    assert!(taken.into_inner(), "it was taken over");
    assert_eq!(uploaded.state(), capture::State::Ingesting);
}

#[tokio::test(flavor = "multi_thread")]
async fn another_writer_that_does_not_end_ends_this_one() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let address = serve(folder.path()).await;
    let earlier = Earlier::begin(&address).await;
    let refused = earlier.upload_beside(async |_| {
        earlier.committed(true).await;
    });
    let refused = refused.await.expect_err("another one writes").to_string();
    assert!(refused.contains("UPLOAD_TAKEN_OVER"), "{refused}");
}
