//! What the service keeps of a capture for people, and lists of captures.

use crate::support::{Service, assert_invalid, assert_refused, id, job_name};
use futures::TryStreamExt;
use tonic::Code;
use yoto_proto::keys;
use yoto_proto::v1::{
    Capture, DeleteJobRequest, DownloadObjectRequest, IngestResult, ListCapturesRequest,
    ListCapturesResponse, ListObjectsRequest, ObjectRef, job_result,
};
use yoto_proto::worker::v1::Lease;

async fn list(
    service: &Service,
    parent: &str,
    page_size: i32,
    token: &str,
) -> ListCapturesResponse {
    let request = ListCapturesRequest {
        parent: parent.into(),
        page_size,
        page_token: token.into(),
    };
    let listed = service.subjects().list_captures(request).await;
    listed.expect("lists").into_inner()
}

/// Ends an ingest job with this thumbnail.
async fn complete(
    service: &Service,
    capture: &Capture,
    lease: &Lease,
    thumbnail: ObjectRef,
) -> Result<(), tonic::Status> {
    let (capture, job) = (id(&capture.name), job_name(lease));
    let put = async |file: &str, bytes: &[u8]| {
        let key = keys::of_capture(capture, id(&job), lease.token, file);
        Some(service.put(&key, bytes).await)
    };
    let result = IngestResult {
        shard: put("shard.bin", b"shard").await,
        check: put(keys::CHECK, b"{}").await,
        thumbnail: Some(thumbnail),
        frames: 2,
        width: 8,
        height: 8,
        ..IngestResult::default()
    };
    service
        .complete(lease, job_result::Kind::Ingest(result))
        .await
}

#[tokio::test]
async fn a_ready_capture_has_a_thumbnail_and_the_report_of_its_check() {
    let service = Service::start().await;
    let subject = service.subject("Ada").await;
    let capture = service.upload_good(&subject.name).await;
    assert_eq!((&*capture.check, &*capture.thumbnail), ("", ""));
    let worker = service.worker(&["ingest"]).await;
    let lease = service.lease(&worker).await.expect("the ingest job waits");
    let foreign = service.put("captures/other/1-1/thumbnail.png", b"x").await;
    let refused = complete(&service, &capture, &lease, foreign).await;
    assert_invalid(refused, "result.ingest.thumbnail.key");
    let job = job_name(&lease);
    let key = keys::of_capture(id(&capture.name), id(&job), lease.token, keys::THUMBNAIL);
    let own = service.put(&key, b"a picture").await;
    complete(&service, &capture, &lease, own)
        .await
        .expect("completes");

    // The job's row may go; the capture stays as it is.
    let request = DeleteJobRequest {
        name: job,
        ..<_>::default()
    };
    service.jobs().delete_job(request).await.expect("is gone");
    service.collect(false, true).await;
    let ready = service.get_capture(&capture.name).await;
    assert_eq!(ready.check, format!("{}/objects/check.json", capture.name));
    let request = ListObjectsRequest {
        parent: capture.name.clone(),
        ..<_>::default()
    };
    let listed = service.objects().list_objects(request).await;
    let listed = listed.expect("lists").into_inner().objects;
    let names: Vec<_> = listed.iter().map(|it| &it.name).collect();
    let frames = format!("{}/objects/{}", capture.name, keys::FRAMES);
    assert_eq!(names, [&ready.check, &frames, &ready.thumbnail]);
    let request = DownloadObjectRequest {
        name: ready.thumbnail,
        ..<_>::default()
    };
    let sent = service.objects().download_object(request).await;
    let sent: Vec<_> = sent
        .expect("is there")
        .into_inner()
        .try_collect()
        .await
        .expect("is whole");
    let bytes: Vec<u8> = sent.into_iter().flat_map(|it| it.chunk).collect();
    assert_eq!(bytes, b"a picture");
    let request = ListObjectsRequest {
        parent: "captures/none".into(),
        ..<_>::default()
    };
    let refused = service.objects().list_objects(request).await;
    assert_refused(refused, Code::NotFound, "NOT_FOUND");
}

#[tokio::test]
async fn captures_are_listed_by_person_in_pages() {
    let service = Service::start().await;
    let (ada, ben) = (service.subject("Ada").await, service.subject("Ben").await);
    let first = service.upload_good(&ada.name).await;
    let other = service.upload_good(&ben.name).await;
    let second = service.upload_good(&ada.name).await;
    let all = list(&service, "", 0, "").await;
    assert_eq!(all.captures, [first.clone(), other, second.clone()]);
    let page = list(&service, &ada.name, 1, "").await;
    assert_eq!(page.captures, [first]);
    let rest = list(&service, &ada.name, 1, &page.next_page_token).await;
    assert_eq!(
        (&*rest.captures, &*rest.next_page_token),
        (&[second][..], "")
    );
    let request = ListCapturesRequest {
        parent: ben.name,
        page_size: 1,
        page_token: page.next_page_token,
    };
    let refused = service.subjects().list_captures(request).await;
    assert_invalid(refused, "page_token");
    let request = ListCapturesRequest {
        parent: "subjects/none".into(),
        ..<_>::default()
    };
    let refused = service.subjects().list_captures(request).await;
    assert_refused(refused, Code::NotFound, "NOT_FOUND");
}
