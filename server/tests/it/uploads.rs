//! Uploads: a good one starts an ingest job, a bad one is refused, an interrupted one continues.

use crate::support;
use crate::support::{
    File, Service, assert_invalid, assert_refused, chunk, chunks, eventually, file, headers, id,
};
use futures::stream::{self, StreamExt};
use std::time::Duration;
use tonic::Code;
use yoto_proto::keys;
use yoto_proto::v1::upload_service_client::UploadServiceClient;
use yoto_proto::v1::{CreateUploadRequest, GetUploadRequest, capture, subject, upload};

#[tokio::test]
async fn an_upload_becomes_an_ingest_job_with_all_its_files() {
    let service = Service::start().await;
    let subject = service.subject("Ada").await;
    assert_eq!(subject.state(), subject::State::Uploading);
    let capture = service.upload_good(&subject.name).await;
    assert_eq!(capture.state(), capture::State::Ingesting);
    assert!(capture.ingest_job.starts_with("jobs/"));
    let subject = service.get_subject(&subject.name).await;
    assert_eq!(subject.state(), subject::State::Ingesting);
    assert_eq!(subject.captures, std::slice::from_ref(&capture.name));

    let worker = service.worker(&["ingest"]).await;
    let lease = service.lease(&worker).await.expect("the ingest job waits");
    let files = lease.inputs.clone().expect("has inputs").files;
    let paths: Vec<_> = files.iter().map(|file| file.path.as_str()).collect();
    assert_eq!(paths, ["frames/000000.png", "poses.json"]);
    assert_eq!(service.ingested(&lease, paths[0]), b"not looked at");
    assert_eq!(service.ingested(&lease, paths[1]), b"{}");
    let parts = lease.inputs.clone().expect("has inputs").parts;
    assert_eq!(parts.len(), 1, "both came in one stream");
    assert_eq!(parts[0].key, keys::upload_part(id(&capture.name), 1, 0));

    service.complete_ingest(&lease).await;
    let capture = service.get_capture(&capture.name).await;
    assert_eq!(capture.state(), capture::State::Ready);
    assert_eq!(
        (capture.frames, capture.width, capture.shard_bytes),
        (2, 8, 5)
    );
    assert_eq!(
        service.get_subject(&subject.name).await.state(),
        subject::State::Ready
    );
}

#[tokio::test]
async fn bad_announcements_are_refused_before_anything_is_written() {
    let service = Service::start_with(|config| {
        config.upload.file_bytes = 100;
        config.upload.capture_bytes = 150;
        config.upload.files = 4;
    })
    .await;
    let subject = service.subject("Ada").await;
    let poses = || file("poses.json", b"{}");
    let open = async |files: Vec<File>| service.open_upload(&subject.name, &files).await;
    for path in [
        "../poses.json",
        "/etc/passwd",
        "a//b",
        "a/./b",
        "a\\b",
        "a b",
        "",
        "poses.json/x",
        "poses.json",
    ] {
        let answer = open(vec![poses(), file(path, b"x")]).await;
        assert_invalid(answer, "files[1].path");
    }
    let mut wrong = file("a", b"");
    wrong.sha256.pop();
    assert_invalid(open(vec![poses(), wrong]).await, "files[1].sha256");
    let large = file("large", &[0; 101]);
    assert_invalid(open(vec![poses(), large]).await, "files[1].bytes");
    let many = vec![poses(), file("a", &[0; 100]), file("b", &[0; 100])];
    assert_invalid(open(many).await, "files[2].bytes");
    let many = ["a", "b", "c", "d", "poses.json"].map(|path| file(path, b"x"));
    assert_invalid(open(many.into()).await, "files");
    assert_invalid(open(vec![file("a", b"x")]).await, "files");
    let nobody = service.open_upload("subjects/nobody", &[poses()]).await;
    assert_refused(nobody, Code::NotFound, "NOT_FOUND");

    assert_eq!(service.stored_files(), [] as [std::path::PathBuf; 0]);
    let subject = service.get_subject(&subject.name).await;
    assert_eq!(subject.captures, [] as [String; 0]);
    assert_eq!(subject.state(), subject::State::Uploading);
}

#[tokio::test]
async fn what_is_good_in_a_stream_is_committed_and_the_rest_refused() {
    let service = Service::start().await;
    let subject = service.subject("Ada").await;
    let files = [file("a", b"0123456789"), file("poses.json", b"{}")];
    let opened = service.open_upload(&subject.name, &files).await;
    let name = opened.expect("is opened").name;
    let committed = async || {
        let upload = service.get_upload(&name).await.expect("is there");
        (upload.committed_bytes, upload.committed.len())
    };
    let chunk = |path, offset, bytes| chunk(&name, path, offset, bytes);

    let mut corrupt = chunk("a", 4, b"4567");
    corrupt.crc32c ^= 1;
    let answer = service.write(vec![chunk("a", 0, b"0123"), corrupt]).await;
    let message = answer
        .as_ref()
        .expect_err("is refused")
        .message()
        .to_owned();
    assert!(message.contains("a: the chunk at 4"), "{message}");
    assert_refused(answer, Code::DataLoss, "CORRUPT_CHUNK");
    assert_eq!(committed().await, (4, 1));

    for offset in [0, 3, 5] {
        let answer = service.write(vec![chunk("a", offset, b"4567")]).await;
        assert_refused(answer, Code::FailedPrecondition, "UPLOAD_OFFSET");
    }
    let twice = vec![chunk("a", 4, b"45"), chunk("a", 4, b"45")];
    let answer = service.write(twice).await;
    assert_refused(answer, Code::FailedPrecondition, "UPLOAD_OFFSET");
    assert_eq!(committed().await, (6, 1));

    let answer = service.write(vec![chunk("a", 6, b"67890")]).await;
    assert_invalid(answer, "chunk");
    let answer = service.write(vec![chunk("b", 0, b"x")]).await;
    assert_invalid(answer, "path");
    assert_invalid(service.write(Vec::new()).await, "upload");
    let mut headless = chunk("a", 6, b"6");
    headless.upload = String::new();
    assert_invalid(service.write(vec![headless]).await, "upload");
    let mut other = chunk("a", 7, b"7");
    other.upload = "uploads/other".into();
    let answer = service.write(vec![chunk("a", 6, b"6"), other]).await;
    assert_invalid(answer, "upload");
    let other = support::chunk("uploads/other", "a", 0, b"0");
    assert_refused(
        service.write(vec![other]).await,
        Code::NotFound,
        "NOT_FOUND",
    );

    let answer = service.finish(&name).await;
    let message = answer
        .as_ref()
        .expect_err("is refused")
        .message()
        .to_owned();
    assert!(message.contains("a: 7 of 10 bytes"), "{message}");
    assert_refused(answer, Code::FailedPrecondition, "UPLOAD_INCOMPLETE");
    let rest = vec![chunk("a", 7, b"789"), chunk("poses.json", 0, b"{}")];
    assert_eq!(service.write(rest).await.expect("writes"), 12);
    let capture = service.finish(&name).await.expect("is complete");
    let again = service.finish(&name).await.expect("is repeated");
    assert_eq!(capture, again, "one capture, one job");
    let late = service.write(vec![chunk("a", 10, b"x")]).await;
    assert_refused(late, Code::FailedPrecondition, "UPLOAD_FINISHED");
    assert_eq!(
        service.ingested(&service.ingest_lease().await, "a"),
        b"0123456789"
    );
}

#[tokio::test]
async fn a_file_that_is_not_the_announced_one_is_sent_again() {
    let service = Service::start().await;
    let subject = service.subject("Ada").await;
    let good = [file("poses.json", b"{}"), file("a", b"good")];
    let name = service.open_upload(&subject.name, &good).await;
    let name = name.expect("is opened").name;
    let bad = [file("poses.json", b"{}"), file("a", b"evil")];
    service.write(chunks(&name, &bad)).await.expect("writes");
    assert_invalid(service.finish(&name).await, "files[\"a\"].sha256");
    let upload = service.get_upload(&name).await.expect("is there");
    assert_eq!(
        (upload.committed_bytes, upload.state()),
        (2, upload::State::Open)
    );
    service
        .write(chunks(&name, &good[1..]))
        .await
        .expect("writes");
    service.finish(&name).await.expect("is the announced one");
    assert_eq!(
        service.ingested(&service.ingest_lease().await, "a"),
        b"good"
    );
}

#[tokio::test]
async fn an_upload_goes_on_after_its_client_or_the_service_has_gone_away() {
    let part: Vec<u8> = (0..100_u8).collect();
    let service = Service::start_with(|config| config.upload.part_bytes = 100).await;
    let subject = service.subject("Ada").await;
    let whole = part.repeat(3);
    let files = [file("poses.json", b"{}"), file("video.mp4", &whole)];
    let name = service.open_upload(&subject.name, &files).await;
    let name = name.expect("is opened").name;
    let connector = service.connector.clone();
    // A separate runtime ends all its tasks at once, as a process would.
    let client = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .enable_all()
        .build()
        .expect("starts");
    let begun = vec![
        chunk(&name, "video.mp4", 0, &part),
        chunk(&name, "video.mp4", 100, &part[..50]),
    ];
    client.spawn(async move {
        let messages = stream::iter(begun).chain(stream::pending());
        UploadServiceClient::new(connector.channel())
            .write_upload(messages)
            .await
            .map(drop)
    });
    // A part is committed while the stream is open, the rest once it has ended.
    let committed = async || {
        let request = GetUploadRequest {
            name: name.clone(),
            stop_writer: false,
        };
        let upload = service.uploads().get_upload(request).await;
        upload.expect("is there").into_inner().committed_bytes
    };
    let full = async || (committed().await == 100).then_some(());
    eventually("the first part", full).await;
    client.shutdown_background();
    let all = async || (committed().await == 150).then_some(());
    eventually("the beginning of the second part", all).await;
    assert_eq!(
        service
            .get_upload(&name)
            .await
            .expect("is there")
            .committed_bytes,
        150
    );

    let dir = service.stop().await;
    let service = Service::start_in(dir, |_| {}).await;
    let upload = service.get_upload(&name).await.expect("is there");
    assert_eq!((upload.committed_bytes, upload.bytes), (150, 302));
    assert_eq!(
        service.get_capture(&upload.capture).await.state(),
        capture::State::Uploading
    );
    let rest = vec![
        chunk(&name, "video.mp4", 150, &whole[150..]),
        chunk(&name, "poses.json", 0, b"{}"),
    ];
    service.write(rest).await.expect("writes");
    service.finish(&name).await.expect("is complete");
    let lease = service.ingest_lease().await;
    assert_eq!(service.ingested(&lease, "video.mp4"), whole);
}

#[tokio::test]
async fn a_writer_that_falls_silent_is_ended_and_one_that_is_lost_does_not_block() {
    let service =
        Service::start_with(|config| config.upload.idle = Duration::from_millis(200)).await;
    let subject = service.subject("Ada").await;
    let files = [file("poses.json", b"{ }")];
    let name = service.open_upload(&subject.name, &files).await;
    let name = name.expect("is opened").name;
    let silent = |offset, bytes| {
        let begun = vec![chunk(&name, "poses.json", offset, bytes)];
        let messages = stream::iter(begun).chain(stream::pending());
        let mut uploads = service.uploads();
        async move { uploads.write_upload(messages).await }
    };
    let answer = silent(0, b"{").await;
    assert_eq!(answer.expect_err("is ended").code(), Code::DeadlineExceeded);
    assert_eq!(
        service
            .get_upload(&name)
            .await
            .expect("is there")
            .committed_bytes,
        1
    );
    drop(service);

    let service = Service::start().await;
    let subject = service.subject("Ada").await;
    let name = service.open_upload(&subject.name, &files).await;
    let name = name.expect("is opened").name;
    let begun = vec![chunk(&name, "poses.json", 0, b"{")];
    let messages = stream::iter(begun).chain(stream::pending());
    let mut uploads = service.uploads();
    let lost = tokio::spawn(async move { uploads.write_upload(messages).await });
    // An hour of silence would not be noticed: the newer call ends the older one.
    let taken = async || {
        let upload = service.get_upload(&name).await.expect("is there");
        (upload.committed_bytes == 1).then_some(())
    };
    eventually("the first byte", taken).await;
    let ended = lost.await.expect("no panic");
    assert_refused(ended, Code::FailedPrecondition, "UPLOAD_TAKEN_OVER");
}

#[tokio::test]
async fn the_same_request_opens_one_upload_even_on_a_full_disk() {
    let service = Service::start().await;
    let subject = service.subject("Ada").await;
    let files = [file("poses.json", b"{}")];
    let request = |files: &[File]| CreateUploadRequest {
        subject: subject.name.clone(),
        files: headers(files),
        request_id: "once".into(),
        validate_only: false,
    };
    let open = async |service: &Service, files: &[File]| {
        let opened = service.uploads().create_upload(request(files)).await;
        opened.map(|answer| answer.into_inner())
    };
    let first = open(&service, &files).await.expect("is opened");
    service
        .write(chunks(&first.name, &files))
        .await
        .expect("writes");
    let dir = service.stop().await;
    let full = |config: &mut yoto_server::ServerConfig| config.storage.min_free_bytes = u64::MAX;
    let service = Service::start_in(dir, full).await;
    let again = open(&service, &files).await.expect("is found");
    assert_eq!((again.name, again.committed_bytes), (first.name.clone(), 2));
    let other = open(&service, &[file("poses.json", b"[]")]).await;
    assert_refused(other, Code::AlreadyExists, "REQUEST_ID_REUSED");
    let new = service.open_upload(&subject.name, &files).await;
    assert_refused(new, Code::ResourceExhausted, "DISK_FULL");
    // An open upload may still end.
    service.finish(&first.name).await.expect("is complete");
    let finished = open(&service, &files).await.expect("is found");
    assert_eq!(finished.state(), upload::State::Finished);
}
