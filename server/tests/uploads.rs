//! Uploads: a good one starts an ingest job, a bad or cut one leaves nothing.

mod support;

use futures::stream::{self, StreamExt};
use std::time::Duration;
use support::{Service, assert_invalid, assert_refused, eventually, file, id, parts};
use tonic::Code;
use yoto_proto::{
    keys,
    v1::{
        GetCaptureRequest, JobError, Violation, capture, end_job_request::Outcome, job, subject,
        subject_service_client::SubjectServiceClient,
    },
};

#[tokio::test]
async fn an_upload_becomes_an_ingest_job_with_all_its_files() {
    let service = Service::start().await;
    let subject = service.subject("Ada").await;
    assert_eq!(subject.state(), subject::State::Uploading);
    let uploaded = service.upload_good(&subject.name).await;
    let capture = uploaded.capture.expect("has a capture");
    assert_eq!(capture.state(), capture::State::Ingesting);
    assert_eq!(capture.ingest_job, uploaded.ingest_job);
    let subject = service.get_subject(&subject.name).await;
    assert_eq!(subject.state(), subject::State::Ingesting);
    assert_eq!(subject.captures, std::slice::from_ref(&capture.name));

    let worker = service.worker(&["ingest"]).await;
    let lease = service.lease(&worker).await.expect("the ingest job waits");
    let files = lease.inputs.clone().expect("has inputs").files;
    let paths: Vec<_> = files.iter().map(|file| file.path.as_str()).collect();
    assert_eq!(paths, ["frames/000000.png", "poses.json"]);
    let object = files[0].object.clone().expect("has an object");
    assert_eq!(
        object.key,
        keys::upload(id(&capture.name), "frames/000000.png")
    );
    let root = service
        .coordinator
        .objects_url()
        .to_file_path()
        .expect("a local store");
    let stored = std::fs::read(root.join(&object.key)).expect("is stored");
    assert_eq!(stored, b"not looked at");
    assert_eq!(yoto_proto::sha256_hex(&stored), object.sha256);

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
async fn bad_uploads_are_refused_and_leave_nothing_behind() {
    let service = Service::start_with(|config| {
        config.upload.file_bytes = 100;
        config.upload.capture_bytes = 150;
        config.upload.files = 4;
    })
    .await;
    let subject = service.subject("Ada").await;
    let poses = || file("poses.json", b"{}");
    for path in [
        "../poses.json",
        "/etc/passwd",
        "a//b",
        "a/./b",
        "a\\b",
        "a b",
        "",
        "poses.json/x",
    ] {
        let answer = service
            .upload(&subject.name, vec![poses(), file(path, b"x")])
            .await;
        assert_invalid(answer, "file.path");
    }
    assert_invalid(
        service.upload(&subject.name, vec![poses(), poses()]).await,
        "file.path",
    );
    let mut wrong = file("frames/0.png", b"the bytes");
    wrong.sha256 = yoto_proto::sha256_hex(b"other bytes");
    assert_invalid(
        service.upload(&subject.name, vec![poses(), wrong]).await,
        "file.sha256",
    );
    let large = file("large", &[0; 101]);
    assert_invalid(
        service.upload(&subject.name, vec![poses(), large]).await,
        "file.bytes",
    );
    let many = vec![poses(), file("a", &[0; 100]), file("b", &[0; 100])];
    assert_invalid(service.upload(&subject.name, many).await, "file.bytes");
    let many = ["a", "b", "c", "d", "poses.json"].map(|path| file(path, b"x"));
    assert_invalid(service.upload(&subject.name, many.into()).await, "file");
    assert_invalid(
        service.upload(&subject.name, vec![file("a", b"x")]).await,
        "file",
    );
    let mut short = parts(&subject.name, vec![poses(), file("a", b"0123456789")]);
    short.pop();
    let answer = service.subjects().upload_capture(stream::iter(short)).await;
    assert_invalid(answer, "chunk");
    let headless = parts(&subject.name, vec![poses()]).split_off(1);
    assert_invalid(
        service
            .subjects()
            .upload_capture(stream::iter(headless))
            .await,
        "header",
    );
    let nobody = service.upload("subjects/nobody", vec![poses()]).await;
    assert_refused(nobody, Code::NotFound, "NOT_FOUND");

    assert_eq!(service.stored_files(), [] as [std::path::PathBuf; 0]);
    let subject = service.get_subject(&subject.name).await;
    assert_eq!(subject.captures, [] as [String; 0]);
    assert_eq!(subject.state(), subject::State::Uploading);
    let worker = service.worker(&["ingest"]).await;
    assert_eq!(service.lease(&worker).await, None);
}

/// The first capture of the subject, as long as it has one.
async fn only_capture(service: &Service, subject: &str) -> Option<String> {
    service.get_subject(subject).await.captures.first().cloned()
}

#[tokio::test]
async fn an_upload_whose_client_goes_away_leaves_nothing_behind() {
    let service = Service::start().await;
    let subject = service.subject("Ada").await;
    let begun = parts(&subject.name, vec![file("poses.json", b"{}")]);
    let connector = service.connector.clone();
    // A runtime of its own ends with everything in it, as a process would.
    let client = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .enable_all()
        .build()
        .expect("starts");
    client.spawn(async move {
        let messages = stream::iter(begun).chain(stream::pending());
        SubjectServiceClient::new(connector.channel())
            .upload_capture(messages)
            .await
            .map(drop)
    });
    let name = eventually("the capture", || only_capture(&service, &subject.name)).await;
    let stored = || async { (service.stored_files().len() == 1).then_some(()) };
    eventually("the stored file", stored).await;
    assert_eq!(
        service.get_capture(&name).await.state(),
        capture::State::Uploading
    );
    client.shutdown_background();
    let gone = || async {
        only_capture(&service, &subject.name)
            .await
            .is_none()
            .then_some(())
    };
    eventually("the removal", gone).await;
    assert_eq!(service.stored_files(), [] as [std::path::PathBuf; 0]);
    let answer = service
        .subjects()
        .get_capture(GetCaptureRequest { name })
        .await;
    assert_refused(answer, Code::NotFound, "NOT_FOUND");
}

#[tokio::test]
async fn an_upload_that_falls_silent_is_ended() {
    let service =
        Service::start_with(|config| config.upload.idle = Duration::from_millis(100)).await;
    let subject = service.subject("Ada").await;
    let begun = parts(&subject.name, vec![file("poses.json", b"{}")]);
    let messages = stream::iter(begun).chain(stream::pending());
    let answer = service.subjects().upload_capture(messages).await;
    assert_eq!(answer.expect_err("is ended").code(), Code::DeadlineExceeded);
    assert_eq!(service.stored_files(), [] as [std::path::PathBuf; 0]);
}

#[tokio::test]
async fn an_upload_cut_by_the_end_of_the_coordinator_is_removed_at_the_next_start() {
    let service = Service::start_with(|config| {
        config.shutdown_grace = Duration::from_millis(50);
    })
    .await;
    let subject = service.subject("Ada").await;
    let begun = parts(&subject.name, vec![file("poses.json", b"{}")]);
    let mut client = service.subjects();
    let messages = stream::iter(begun).chain(stream::pending());
    let call = tokio::spawn(async move { client.upload_capture(messages).await.map(drop) });
    let stored = || async { (service.stored_files().len() == 1).then_some(()) };
    eventually("the stored file", stored).await;
    let dir = service.stop().await;
    let service = Service::start_in(dir, |_| {}).await;
    assert_eq!(service.stored_files(), [] as [std::path::PathBuf; 0]);
    assert_eq!(
        service.get_subject(&subject.name).await.captures,
        [] as [String; 0]
    );
    call.abort();
}

#[tokio::test]
async fn a_rejected_capture_stays_visible_and_a_good_one_heals_the_subject() {
    let service = Service::start().await;
    let subject = service.subject("Ada").await;
    let first = service
        .upload_good(&subject.name)
        .await
        .capture
        .expect("has one")
        .name;
    let worker = service.worker(&["ingest"]).await;
    let lease = service.lease(&worker).await.expect("the ingest job waits");
    let violation = Violation {
        code: "NOT_FINITE".into(),
        file: "poses.json".into(),
        frame: Some(17),
        field: "pose[41]".into(),
        message: "NaN".into(),
    };
    let error = JobError {
        code: "REJECTED".into(),
        message: "poses".into(),
        violations: vec![violation.clone()],
    };
    let ended = service.end(&lease, Outcome::Failed(error.clone())).await;
    ended.expect("is recorded");
    let job = service.get_job(&support::job_name(&lease)).await;
    assert_eq!((job.state(), job.error), (job::State::Failed, Some(error)));
    let capture = service.get_capture(&first).await;
    assert_eq!(capture.state(), capture::State::Rejected);
    assert_eq!(capture.violations, [violation]);
    assert_eq!(
        service.get_subject(&subject.name).await.state(),
        subject::State::Rejected
    );

    let second = service
        .upload_good(&subject.name)
        .await
        .capture
        .expect("has one")
        .name;
    assert_eq!(
        service.get_subject(&subject.name).await.state(),
        subject::State::Ingesting
    );
    let lease = service.lease(&worker).await.expect("the ingest job waits");
    service.complete_ingest(&lease).await;
    let healed = service.get_subject(&subject.name).await;
    assert_eq!(healed.state(), subject::State::Ready);
    assert_eq!(healed.captures, [first, second]);
}

#[tokio::test]
async fn a_file_larger_than_memory_holds_is_stored_whole_or_not_at_all() {
    let service = Service::start().await;
    let subject = service.subject("Ada").await;
    let large: Vec<u8> = (0..(9usize << 20)).map(|i| (i / 7 % 251) as u8).collect();
    let poses = || file("poses.json", b"{}");
    let good = service
        .upload(&subject.name, vec![file("video.mp4", &large), poses()])
        .await
        .expect("is taken");
    let capture = good.capture.expect("has one").name;
    let root = service
        .coordinator
        .objects_url()
        .to_file_path()
        .expect("a local store");
    let key = keys::upload(id(&capture), "video.mp4");
    assert_eq!(std::fs::read(root.join(key)).expect("is stored"), large);
    let before = service.stored_files();

    let mut wrong = file("video.mp4", &large);
    wrong.sha256 = yoto_proto::sha256_hex(b"other bytes");
    let answer = service.upload(&subject.name, vec![wrong, poses()]).await;
    assert_invalid(answer, "file.sha256");
    let mut cut = parts(&subject.name, vec![file("video.mp4", &large)]);
    cut.pop();
    let answer = service.subjects().upload_capture(stream::iter(cut)).await;
    assert_invalid(answer, "chunk");
    assert_eq!(service.stored_files(), before);
}

#[tokio::test]
async fn an_ingest_that_failed_for_want_of_the_store_is_tried_again_and_rejects_nothing() {
    let service = Service::start().await;
    let subject = service.subject("Ada").await;
    let capture = service
        .upload_good(&subject.name)
        .await
        .capture
        .expect("has one")
        .name;
    let worker = service.worker(&["ingest"]).await;
    let lease = service.lease(&worker).await.expect("the ingest job waits");
    let error = support::job_error("OBJECTS", "the store is out of reach");
    let ended = service.end(&lease, Outcome::Postponed(error)).await;
    ended.expect("is recorded");
    let job = service.get_job(&support::job_name(&lease)).await;
    assert_eq!((job.state(), job.error), (job::State::Queued, None));
    let waiting = service.get_capture(&capture).await;
    assert_eq!(waiting.state(), capture::State::Ingesting);
    assert_eq!(service.lease(&worker).await, None, "not at once");
    let again = eventually("the next try", || service.lease(&worker)).await;
    assert_eq!(again.token, lease.token + 1);
    service.complete_ingest(&again).await;
    let done = service.get_capture(&capture).await;
    assert_eq!(done.state(), capture::State::Ready);
}
