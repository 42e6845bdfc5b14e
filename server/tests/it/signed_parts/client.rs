//! The client writes parts into the store, and leaves to the service what it can't.

use super::Stage;
use crate::support::{File, file, headers};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use yoto_client::{ClientError, FileSource, UploadFile, YotoClient};
use yoto_proto::v1::Capture;
use yoto_test_s3::S3Fault;

const PART: u64 = 64 << 10;
/// Parts of the film: the last one is too small for a URL.
const FULL: u64 = 5;
const REST: u64 = 5000;

fn files() -> Vec<File> {
    let bytes = FULL * PART + REST - 2;
    let film: Vec<u8> = (0..bytes).map(|n| (n % 251) as u8).collect();
    vec![file("poses.json", b"{}"), file("video.mp4", &film)]
}

fn sources(files: &[File]) -> Vec<UploadFile> {
    let source = |file: &File| UploadFile {
        path: file.path.clone(),
        source: FileSource::Memory(file.bytes.clone()),
    };
    files.iter().map(source).collect()
}

impl Stage {
    /// A client that uses a store without TLS, as it uses the service.
    fn client(&self) -> YotoClient {
        YotoClient::new(self.service.channel.clone()).with_clear_store()
    }

    /// Uploads `files`, all of whose bytes are told once.
    async fn upload(&self, client: &YotoClient, files: &[File]) -> Result<Capture, ClientError> {
        let mut told = 0;
        let uploaded = client
            .upload_capture(&self.subject, sources(files), |bytes| told += bytes)
            .await;
        let all: u64 = headers(files).iter().map(|it| it.bytes).sum();
        assert!(uploaded.is_err() || told == all, "{told} of {all}");
        uploaded
    }
}

#[tokio::test]
async fn full_parts_go_into_the_store_and_the_rest_through_the_service() {
    let stage = Stage::start(PART, |_| {}).await;
    let files = files();
    let capture = stage.upload(&stage.client(), &files).await;
    assert_eq!(stage.server.signed(), FULL);
    let parts = stage.stored(&capture.expect("arrives").name);
    assert_eq!(parts.len() as u64, FULL + 1, "{parts:?}");
    stage.assert_ingested(&files).await;
}

#[tokio::test]
async fn many_files_share_a_part() {
    let stage = Stage::start(PART, |_| {}).await;
    let mut files = vec![file("poses.json", b"{}"), file("empty", b"")];
    for n in 0..3000_u32 {
        let content = n.to_le_bytes().repeat(10);
        files.push(file(&format!("frames/{n:06}.png"), &content));
    }
    let capture = stage.upload(&stage.client(), &files).await;
    // A part takes 1024 files, far fewer bytes than it has room for.
    assert_eq!(stage.server.signed(), 3);
    assert_eq!(stage.stored(&capture.expect("arrives").name).len(), 3);
    stage.assert_ingested(&files).await;
}

#[tokio::test]
async fn a_program_that_ends_leaves_what_is_committed_and_the_next_one_goes_on() {
    let stage = Stage::start(PART, |_| {}).await;
    let files = files();
    let (client, subject, sent) = (stage.client(), stage.subject.clone(), sources(&files));
    let ended = tokio::spawn(async move {
        let end = |_| panic!("the program ends after its first commit");
        client.upload_capture(&subject, sent, end).await
    });
    assert!(ended.await.expect_err("it ends").is_panic());
    assert_eq!(stage.server.signed(), 4, "written at once");
    let capture = stage.upload(&stage.client(), &files).await;
    assert_eq!(stage.server.signed(), 4 + FULL - 1, "one was committed");
    let name = capture.expect("arrives").name;
    stage.service.collect(false, false).await;
    let parts = stage.stored(&name);
    assert_eq!(parts.len() as u64, FULL + 1, "{parts:?}");
    stage.assert_ingested(&files).await;
}

#[tokio::test]
async fn connections_that_break_lose_nothing() {
    let stage = Stage::start(PART, |_| {}).await;
    let files = files();
    stage.server.fail(S3Fault::CutRequests);
    let uploaded = stage.upload(&stage.client(), &files).await;
    stage.server.heal();
    uploaded.expect("arrives");
    assert!(stage.server.signed() > 1 && stage.server.failed() > 0);
    stage.assert_ingested(&files).await;
}

/// Uploads twice with one client, of which only the first upload tries the store, with as many parts as go at once.
async fn assert_tried_once(stage: &Stage, client: &YotoClient, tries: u64) {
    for _ in 0..2 {
        let files = files();
        stage.upload(client, &files).await.expect("arrives");
        assert_eq!(stage.server.signed(), tries);
        stage.assert_ingested(&files).await;
    }
}

#[tokio::test]
async fn urls_that_have_ended_are_refused_and_the_service_takes_the_bytes() {
    let stage = Stage::start(PART, |config| config.signed_urls = Some(Duration::ZERO)).await;
    assert_tried_once(&stage, &stage.client(), 4).await;
}

#[tokio::test]
async fn a_store_out_of_reach_is_tried_once() {
    let stage = Stage::start(PART, |_| {}).await;
    stage.server.fail(S3Fault::NoSigned);
    assert_tried_once(&stage, &stage.client(), 4).await;
}

#[tokio::test]
async fn without_urls_the_service_takes_the_bytes() {
    let stage = Stage::start(PART, |config| config.signed_urls = None).await;
    assert_tried_once(&stage, &stage.client(), 0).await;
}

#[tokio::test]
async fn without_tls_nothing_goes_there_from_a_client_that_has_tls_to_the_service() {
    let stage = Stage::start(PART, |_| {}).await;
    let client = YotoClient::new(stage.service.channel.clone());
    assert_tried_once(&stage, &client, 0).await;
}

#[tokio::test]
async fn bytes_that_the_store_has_altered_are_sent_again_through_the_service() {
    let stage = Stage::start(PART, |_| {}).await;
    let files = files();
    let first = Arc::new(Mutex::new(true));
    let folder = stage.path("uploads");
    let alter = |_| {
        // After the first commit.
        if std::mem::take(&mut *first.lock().expect("no panic")) {
            for upload in std::fs::read_dir(&folder).expect("lists") {
                let parts = upload.expect("an entry").path().join("parts");
                for part in std::fs::read_dir(parts).expect("lists") {
                    let path = part.expect("an entry").path();
                    let mut bytes = std::fs::read(&path).expect("reads");
                    bytes[9] ^= 1;
                    std::fs::write(path, bytes).expect("writes");
                }
            }
        }
    };
    let client = stage.client();
    let uploaded = client.upload_capture(&stage.subject, sources(&files), alter);
    uploaded.await.expect("arrives");
    assert_eq!(stage.server.signed(), FULL);
    stage.assert_ingested(&files).await;
}
