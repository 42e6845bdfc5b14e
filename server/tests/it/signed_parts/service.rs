//! What the service signs and commits.

use super::{Stage, new, piece, put};
use crate::support::{
    Service, assert_invalid, assert_refused, chunk, chunks, eventually, file, id,
};
use tonic::Code;
use yoto_proto::keys;
use yoto_proto::v1::{GetUploadRequest, SignPartsRequest, Unsigned};
use yoto_server::{Admission, Tenant, in_memory};

/// Bytes of a part; the smallest has 2.
const PART: u64 = 16;
const FIRST: &str = "0123456789abcdef";
const SECOND: &str = "ghijklmn";

fn film() -> String {
    format!("{FIRST}{SECOND}")
}

#[tokio::test]
async fn a_part_is_committed_once_it_is_in_the_store() {
    let stage = Stage::start(PART, |_| {}).await;
    let (name, files) = stage.open(&film()).await;
    let parts = [(0, FIRST), (1, SECOND)];
    let signed = stage.sign(&name, 0, &parts).await.expect("signs");
    let life = "X-Amz-Expires=120";
    assert!(signed.parts.iter().all(|it| it.url.contains(life)));
    assert!(signed.expire_time.is_some());
    let writer = signed.writer;
    let early = stage.commit(&name, writer, parts[0], 0).await;
    assert_refused(early, Code::FailedPrecondition, "UPLOAD_INCOMPLETE");
    for (part, (_, bytes)) in signed.parts.iter().zip(parts) {
        assert_eq!(stage.put(part, bytes).await, 200);
    }
    // An answer may be lost, and the call repeated.
    for _ in 0..2 {
        let committed = stage.commit(&name, writer, parts[0], 0).await;
        committed.expect("is in the store");
    }
    stage
        .commit(&name, writer, parts[1], FIRST.len() as u64)
        .await
        .expect("follows");
    assert_eq!(stage.committed(&name).await, PART + SECOND.len() as u64);
    let rest = vec![chunk(&name, "poses.json", 0, b"{}")];
    stage.service.write(rest).await.expect("a stream goes on");
    stage.service.finish(&name).await.expect("is whole");
    stage.assert_ingested(&files).await;
    let late = stage.sign(&name, 0, &parts).await;
    assert_refused(late, Code::FailedPrecondition, "UPLOAD_FINISHED");
}

#[tokio::test]
async fn a_url_takes_the_bytes_that_were_signed_and_no_others() {
    let stage = Stage::start(PART, |_| {}).await;
    let (name, _) = stage.open(&film()).await;
    let signed = stage.sign(&name, 0, &[(0, FIRST)]).await.expect("signs");
    let part = &signed.parts[0];
    for other in ["0123456789abcdeX", "0123456789abcdefg"] {
        assert_eq!(stage.put(part, other).await, 400, "{other}");
    }
    assert_eq!(put(&part.url, "", "0123456789abcdeX").await, 403);
    assert_eq!(stage.put(part, FIRST).await, 200);
}

#[tokio::test]
async fn other_bytes_in_a_store_without_checksums_are_found() {
    let stage = Stage::start(PART, |_| {}).await;
    let (name, files) = stage.open(&film()).await;
    let signed = stage.sign(&name, 0, &[(0, FIRST)]).await.expect("signs");
    assert_eq!(stage.put(&signed.parts[0], FIRST).await, 200);
    let path = stage.path(&keys::upload_part(id(&name), signed.writer, 0));
    std::fs::write(&path, "0123").expect("is written");
    let short = stage.commit(&name, signed.writer, (0, FIRST), 0).await;
    let told = short.as_ref().expect_err("is refused").message().to_owned();
    assert!(told.contains("4 bytes"), "{told}");
    assert_refused(short, Code::FailedPrecondition, "UPLOAD_INCOMPLETE");

    std::fs::write(&path, "0123456789abcdeX").expect("is written");
    let same_size = stage.commit(&name, signed.writer, (0, FIRST), 0).await;
    same_size.expect("nobody has read it");
    let rest = vec![
        chunk(&name, "video.mp4", PART, SECOND.as_bytes()),
        chunk(&name, "poses.json", 0, b"{}"),
    ];
    stage.service.write(rest).await.expect("goes on");
    let finished = stage.service.finish(&name).await;
    assert_refused(finished, Code::FailedPrecondition, "UPLOAD_INCOMPLETE");
    let again = chunks(&name, &files[..1]);
    stage.service.write(again).await.expect("is sent again");
    stage.service.finish(&name).await.expect("is whole");
    stage.assert_ingested(&files).await;
}

#[tokio::test]
async fn the_later_of_two_writers_takes_over() {
    let stage = Stage::start(PART, |_| {}).await;
    let (name, files) = stage.open(&film()).await;
    let first = stage.sign(&name, 0, &[(0, FIRST)]).await.expect("signs");
    assert_eq!(stage.put(&first.parts[0], FIRST).await, 200);
    let second = stage.sign(&name, 0, &[(0, FIRST)]).await.expect("signs");
    assert_eq!(stage.put(&second.parts[0], FIRST).await, 200);
    let lost = stage.commit(&name, first.writer, (0, FIRST), 0).await;
    assert_refused(lost, Code::FailedPrecondition, "UPLOAD_TAKEN_OVER");
    stage.service.collect(false, false).await;
    let removed = stage.commit(&name, first.writer, (0, FIRST), 0).await;
    assert_refused(removed, Code::FailedPrecondition, "UPLOAD_TAKEN_OVER");
    let lost = stage.sign(&name, first.writer, &[(1, FIRST)]).await;
    assert_refused(lost, Code::FailedPrecondition, "UPLOAD_TAKEN_OVER");
    let committed = stage.commit(&name, second.writer, (0, FIRST), 0).await;
    committed.expect("is the newest");
    // A stream is a writer too.
    let rest = vec![chunk(&name, "video.mp4", PART, SECOND.as_bytes())];
    stage.service.write(rest).await.expect("takes over");
    let lost = stage.sign(&name, second.writer, &[(1, FIRST)]).await;
    assert_refused(lost, Code::FailedPrecondition, "UPLOAD_TAKEN_OVER");
    // Its commit is repeated late, and was committed.
    let again = stage.commit(&name, second.writer, (0, FIRST), 0).await;
    again.expect("is committed");

    let rest = vec![chunk(&name, "poses.json", 0, b"{}")];
    stage.service.write(rest).await.expect("goes on");
    stage.service.finish(&name).await.expect("is whole");
    // The URL of the first writer has not ended.
    assert_eq!(stage.put(&first.parts[0], FIRST).await, 200);
    stage.service.collect(false, false).await;
    let named = stage.stored(&name);
    assert!(!named.contains(&format!("{}-0", first.writer)), "{named:?}");
    stage.assert_ingested(&files).await;
}

#[tokio::test]
async fn a_stream_that_writes_stops_for_a_writer_of_parts() {
    let stage = Stage::start(PART, |_| {}).await;
    let (name, _) = stage.open(&film()).await;
    let (chunks, queue) = tokio::sync::mpsc::channel(4);
    for begun in [
        chunk(&name, "video.mp4", 0, FIRST.as_bytes()),
        chunk(&name, "poses.json", 0, b"{"),
    ] {
        chunks.send(begun).await.expect("is sent");
    }
    let mut uploads = stage.service.uploads();
    let stream = tokio_stream::wrappers::ReceiverStream::new(queue);
    let writing = tokio::spawn(async move { uploads.write_upload(stream).await });
    eventually("the first part", async || {
        let request = GetUploadRequest {
            name: name.clone(),
            stop_writer: false,
        };
        let found = stage.service.uploads().get_upload(request).await;
        let committed = found.expect("is there").into_inner().committed_bytes;
        (committed == PART).then_some(())
    })
    .await;
    let signed = stage.sign(&name, 0, &[(0, SECOND)]).await.expect("signs");
    let stopped = writing.await.expect("no panic");
    assert_refused(stopped, Code::FailedPrecondition, "UPLOAD_TAKEN_OVER");
    drop(chunks);
    assert_eq!(stage.put(&signed.parts[0], SECOND).await, 200);
    let committed = stage.commit(&name, signed.writer, (0, SECOND), PART).await;
    committed.expect("follows what the stream has committed");
}

#[tokio::test]
async fn parts_are_committed_in_the_order_of_their_numbers() {
    let stage = Stage::start(PART, |_| {}).await;
    let (name, _) = stage.open(&film()).await;
    let (first, second) = ((7, FIRST), (3, SECOND));
    let signed = stage.sign(&name, 0, &[first, second]).await.expect("signs");
    for (part, (_, bytes)) in signed.parts.iter().zip([first, second]) {
        assert_eq!(stage.put(part, bytes).await, 200);
    }
    let writer = signed.writer;
    stage.commit(&name, writer, first, 0).await.expect("is new");
    let before = stage.commit(&name, writer, second, PART).await;
    assert_refused(before, Code::FailedPrecondition, "UPLOAD_OFFSET");
    // Not the bytes that are committed.
    let path = stage.path(&keys::upload_part(id(&name), writer, 7));
    std::fs::write(path, SECOND).expect("is written");
    let other = stage.commit(&name, writer, (7, SECOND), PART).await;
    assert_refused(other, Code::FailedPrecondition, "UPLOAD_OFFSET");
    assert_eq!(stage.committed(&name).await, PART);
}

#[tokio::test]
async fn wrong_parts_are_refused() {
    let stage = Stage::start(PART, |_| {}).await;
    let (name, _) = stage.open(&film()).await;
    let sign = async |parts: &[(u32, &str)]| stage.sign(&name, 0, parts).await;
    assert_invalid(sign(&[]).await, "parts");
    assert_invalid(sign(&[(0, FIRST); 17]).await, "parts");
    assert_invalid(sign(&[(0, FIRST), (1, "a")]).await, "parts[1].bytes");
    assert_invalid(sign(&[(0, &film())]).await, "parts[0].bytes");
    let mut upper = new(0, FIRST);
    upper.sha256 = upper.sha256.to_uppercase();
    let request = SignPartsRequest {
        upload: name.clone(),
        writer: 0,
        parts: vec![upper],
    };
    let refused = stage.service.uploads().sign_parts(request).await;
    assert_invalid(refused, "parts[0].sha256");

    let signed = sign(&[(0, FIRST)]).await.expect("signs");
    assert_eq!(stage.put(&signed.parts[0], FIRST).await, 200);
    let commit = async |pieces| {
        let part = (0, FIRST);
        stage
            .commit_pieces(&name, signed.writer, part, pieces)
            .await
    };
    assert_invalid(commit(vec![]).await, "pieces");
    assert_invalid(commit(vec![piece("video.mp4", 0, 15)]).await, "pieces");
    let empty = vec![piece("video.mp4", 0, 16), piece("poses.json", 0, 0)];
    assert_invalid(commit(empty).await, "pieces");
    assert_invalid(
        commit(vec![piece("video.mp4", u64::MAX, 16)]).await,
        "pieces",
    );
    for wrong in [
        piece("video.mp4", 1, 16),
        piece("poses.json", 0, 16),
        piece("a", 0, 16),
    ] {
        let refused = commit(vec![wrong]).await;
        assert_refused(refused, Code::FailedPrecondition, "UPLOAD_OFFSET");
    }
    assert_eq!(stage.committed(&name).await, 0);
}

#[tokio::test]
async fn a_part_has_1024_pieces_at_most() {
    let film = "f".repeat(1025);
    let stage = Stage::start(2048, |_| {}).await;
    let (name, _) = stage.open(&film).await;
    let signed = stage.sign(&name, 0, &[(0, &film)]).await.expect("signs");
    assert_eq!(stage.put(&signed.parts[0], &film).await, 200);
    let pieces = (0..1025).map(|at| piece("video.mp4", at, 1)).collect();
    let refused = stage.commit_pieces(&name, signed.writer, (0, &film), pieces);
    assert_invalid(refused.await, "pieces");
}

#[tokio::test]
async fn an_upload_has_no_more_pieces_than_a_lease_can_list() {
    let stage = Stage::start(PART, |_| {}).await;
    let (name, _) = stage.open(&film()).await;
    let parts = [(0, FIRST), (1, SECOND)];
    let signed = stage.sign(&name, 0, &parts).await.expect("signs");
    for (part, (_, bytes)) in signed.parts.iter().zip(parts) {
        assert_eq!(stage.put(part, bytes).await, 200);
    }
    let writer = signed.writer;
    let first = stage.commit(&name, writer, parts[0], 0).await;
    first.expect("is the first piece");
    let most = yoto_proto::limits::UPLOAD_PIECES;
    let more = format!(
        "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < {most} - 1)
         INSERT INTO upload_pieces (capture, path, start, bytes, writer, number, part_start)
         SELECT '{}', 'video.mp4', 100 + i, 1, {writer}, 0, 100 + i FROM n",
        id(&name)
    );
    stage.service.database.run(&more).await;
    let one_more = stage.commit(&name, writer, parts[1], PART).await;
    assert_invalid(one_more, "pieces");
}

#[tokio::test]
async fn another_tenants_upload_is_not_found() {
    let mut stage = Stage::start(PART, |_| {}).await;
    let (name, _) = stage.open(&film()).await;
    let signed = stage.sign(&name, 0, &[(0, FIRST)]).await.expect("signs");
    assert_eq!(stage.put(&signed.parts[0], FIRST).await, 200);
    let own = stage.service.channel.clone();
    let (connector, incoming) = in_memory();
    let tenant = Tenant::new("other").expect("an id");
    let admission = Admission::Process(tenant);
    let serving = (stage.service.coordinator).serve_to(admission, incoming, std::future::pending());
    tokio::spawn(serving);
    stage.service.channel = connector.channel();
    for writer in [0, signed.writer] {
        let refused = stage.sign(&name, writer, &[(1, FIRST)]).await;
        assert_refused(refused, Code::NotFound, "NOT_FOUND");
    }
    let refused = stage.commit(&name, signed.writer, (0, FIRST), 0).await;
    assert_refused(refused, Code::NotFound, "NOT_FOUND");
    stage.service.channel = own;
    let committed = stage.commit(&name, signed.writer, (0, FIRST), 0).await;
    committed.expect("nobody has taken it over");
}

#[tokio::test]
async fn without_urls_the_answer_says_why_and_nobody_is_stopped() {
    let turned_off = Stage::start(PART, |config| config.signed_urls = None).await;
    let (name, _) = turned_off.open(&film()).await;
    let answer = turned_off.sign(&name, 0, &[(0, FIRST)]).await;
    let answer = answer.expect("answers");
    assert_eq!(answer.unsigned(), Unsigned::TurnedOff);
    assert_eq!((answer.writer, answer.parts.len()), (0, 0));

    let service = Service::start_with(|config| config.signed_urls = Some(super::LIFE)).await;
    if std::env::var_os(crate::support::ON_S3).is_some() {
        return;
    }
    let subject = service.subject("Ada").await;
    let files = [file("poses.json", b"{}")];
    let name = service.open_upload(&subject.name, &files).await;
    let request = SignPartsRequest {
        upload: name.expect("is opened").name,
        writer: 0,
        parts: vec![],
    };
    let answer = service.uploads().sign_parts(request).await;
    let answer = answer.expect("answers").into_inner();
    assert_eq!(answer.unsigned(), Unsigned::NotSupported);
}
