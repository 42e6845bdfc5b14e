//! Parts of uploads that clients write into the object store by signed URLs.

mod client;
mod service;

use crate::support::{File, Service, ask_with, file, id};
use std::path::PathBuf;
use std::time::Duration;
use tonic::{Response, Status};
use url::Url;
use yoto_proto::keys;
use yoto_proto::v1::{
    CommitPartRequest, NewPart, PartPiece, SignPartsRequest, SignPartsResponse, SignedPart,
};
use yoto_server::ServerConfig;
use yoto_test_s3::{BUCKET, Server};

const LIFE: Duration = Duration::from_secs(900);

/// A service on S3 with a person.
struct Stage {
    server: Server,
    service: Service,
    subject: String,
}

impl Stage {
    async fn start(part_bytes: u64, change: impl FnOnce(&mut ServerConfig)) -> Self {
        let server = Server::start();
        let environment = server.environment();
        let service = Service::start_with(|config| {
            config.objects = Some(Url::parse(&format!("s3://{BUCKET}/yoto")).expect("a URL"));
            config.environment = environment.into();
            config.signed_urls = Some(LIFE);
            config.upload.part_bytes = part_bytes;
            change(config);
        })
        .await;
        Self {
            subject: service.subject("Ada").await.name,
            server,
            service,
        }
    }

    /// Where the store has `key`.
    fn path(&self, key: &str) -> PathBuf {
        self.server.folder().join("yoto").join(key)
    }

    /// The names of the parts of `upload` in the store, such as "1-0".
    fn stored(&self, upload: &str) -> Vec<String> {
        let folder = self.path(&keys::upload_parts(id(upload)));
        let entries = std::fs::read_dir(folder).into_iter().flatten();
        let names = entries.map(|it| it.expect("an entry").file_name());
        let mut names: Vec<String> = names.map(|it| it.to_string_lossy().into()).collect();
        names.retain(|it| !it.starts_with('.'));
        names.sort();
        names
    }

    /// Leases the ingest job and compares its files with `files`.
    async fn assert_ingested(&self, files: &[File]) {
        let lease = self.service.ingest_lease().await;
        for file in files {
            let found = Service::ingested_from(&lease, &file.path, |key| self.path(key));
            assert!(found == file.bytes, "{}", file.path);
        }
    }

    /// Opens an upload of a film of `content` and of poses.
    async fn open(&self, content: &str) -> (String, [File; 2]) {
        let files = [
            file("video.mp4", content.as_bytes()),
            file("poses.json", b"{}"),
        ];
        let opened = self.service.open_upload(&self.subject, &files).await;
        (opened.expect("is opened").name, files)
    }

    /// Asks for URLs of parts with these numbers and bytes.
    async fn sign(
        &self,
        upload: &str,
        writer: u64,
        parts: &[(u32, &str)],
    ) -> Result<SignPartsResponse, Status> {
        let parts = parts.iter().map(|(number, bytes)| new(*number, bytes));
        let request = SignPartsRequest {
            upload: upload.into(),
            writer,
            parts: parts.collect(),
        };
        let signed = self.service.uploads().sign_parts(request).await;
        signed.map(Response::into_inner)
    }

    /// Writes `body` by a signed URL. Returns the status of the answer.
    async fn put(&self, part: &SignedPart, body: &str) -> u16 {
        let headers = part.headers.iter();
        let headers: String = headers.map(|(k, v)| format!("{k}: {v}\r\n")).collect();
        put(&part.url, &headers, body).await
    }

    /// Commits a part of the film from `offset` on.
    async fn commit(
        &self,
        upload: &str,
        writer: u64,
        (number, bytes): (u32, &str),
        offset: u64,
    ) -> Result<(), Status> {
        let piece = piece("video.mp4", offset, bytes.len());
        self.commit_pieces(upload, writer, (number, bytes), vec![piece])
            .await
    }

    async fn commit_pieces(
        &self,
        upload: &str,
        writer: u64,
        (number, bytes): (u32, &str),
        pieces: Vec<PartPiece>,
    ) -> Result<(), Status> {
        let request = CommitPartRequest {
            upload: upload.into(),
            writer,
            part: Some(new(number, bytes)),
            pieces,
        };
        let committed = self.service.uploads().commit_part(request).await;
        committed.map(drop)
    }

    async fn committed(&self, upload: &str) -> u64 {
        let found = self.service.get_upload(upload).await;
        found.expect("is there").committed_bytes
    }
}

fn new(number: u32, bytes: &str) -> NewPart {
    NewPart {
        number,
        bytes: bytes.len() as u64,
        sha256: yoto_proto::sha256_hex(bytes.as_bytes()),
    }
}

fn piece(path: &str, offset: u64, bytes: usize) -> PartPiece {
    PartPiece {
        path: path.into(),
        offset,
        bytes: bytes as u64,
    }
}

async fn put(url: &str, headers: &str, body: &str) -> u16 {
    let url = Url::parse(url).expect("a URL");
    let address = url.socket_addrs(|| None).expect("an address")[0];
    let path = format!("{}?{}", url.path(), url.query().expect("is signed"));
    ask_with(address, "PUT", &path, headers, body).await.0
}
