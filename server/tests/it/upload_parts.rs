//! Parts of uploads: which objects they become, and what is found when one is lost.

use crate::support::{Service, assert_refused, chunk, chunks, file, id};
use tonic::Code;

#[tokio::test]
async fn acknowledged_bytes_that_are_lost_on_disk_are_found_before_the_ingest() {
    let service = Service::start().await;
    let subject = service.subject("Ada").await;
    let files = [file("poses.json", b"{}"), file("a", b"0123456789")];
    let name = service.open_upload(&subject.name, &files).await;
    let name = name.expect("is opened").name;
    service.write(chunks(&name, &files)).await.expect("writes");
    let lost = async |expected: u64| {
        let answer = service.finish(&name).await;
        let message = answer.as_ref().expect_err("is lost").message().to_owned();
        assert!(message.starts_with("a: "), "{message}");
        assert_refused(answer, Code::FailedPrecondition, "UPLOAD_INCOMPLETE");
        let upload = service.get_upload(&name).await.expect("is there");
        assert_eq!(upload.committed_bytes, expected);
        // What no row names any more.
        service.collect(false, true).await;
    };
    let part = || {
        let mut parts = service.parts(&name);
        assert_eq!(parts.len(), 1, "small parts are joined: {parts:?}");
        parts.remove(0).0
    };
    std::fs::write(part(), b"{}01234x6789").expect("is altered");
    // The other file of the part has its bytes, but an ingest job compares the part.
    lost(0).await;
    service
        .write(chunks(&name, &files))
        .await
        .expect("it starts anew");
    std::fs::write(part(), b"{}01234x6789012").expect("is torn");
    lost(0).await;
    service.write(chunks(&name, &files)).await.expect("writes");
    std::fs::remove_file(part()).expect("is lost");
    lost(0).await;
    service
        .write(vec![chunk(&name, "a", 0, b"0123")])
        .await
        .expect("it starts anew");
    std::fs::write(part(), b"01").expect("is torn");
    let answer = service.write(vec![chunk(&name, "a", 4, b"456789")]).await;
    assert_refused(answer, Code::FailedPrecondition, "UPLOAD_INCOMPLETE");
    service
        .write(chunks(&name, &files))
        .await
        .expect("it starts anew");
    service.finish(&name).await.expect("is whole");
    let lease = service.ingest_lease().await;
    assert_eq!(service.ingested(&lease, "a"), b"0123456789");
}

#[tokio::test]
async fn a_line_that_breaks_after_each_byte_makes_few_parts() {
    const PART_BYTES: u64 = 80;
    let service = Service::start_with(|config| config.upload.part_bytes = PART_BYTES).await;
    let subject = service.subject("Ada").await;
    let whole: Vec<u8> = (0..200).collect();
    let files = [file("poses.json", b"{}"), file("video.mp4", &whole)];
    let name = service.open_upload(&subject.name, &files).await;
    let name = name.expect("is opened").name;
    for (offset, byte) in (0..).zip(&whole[..60]) {
        let byte = std::slice::from_ref(byte);
        let written = service
            .write(vec![chunk(&name, "video.mp4", offset, byte)])
            .await;
        written.expect("is committed");
    }
    let parts = service.parts(&name);
    let least = PART_BYTES / 8;
    assert_eq!(parts.len() as u64, 60 / least, "{parts:?}");
    assert!(parts.iter().all(|(_, bytes)| *bytes == least), "{parts:?}");
    // One chunk is more than a part has room for.
    let rest = vec![
        chunk(&name, "video.mp4", 60, &whole[60..]),
        chunk(&name, "poses.json", 0, b"{}"),
    ];
    service.write(rest).await.expect("writes");
    service.finish(&name).await.expect("is complete");
    let parts = service.parts(&name);
    assert!(
        parts.iter().all(|(_, bytes)| *bytes <= PART_BYTES + least),
        "{parts:?}"
    );
    let lease = service.ingest_lease().await;
    assert_eq!(service.ingested(&lease, "video.mp4"), whole);
    assert_eq!(service.ingested(&lease, "poses.json"), b"{}");
    let inputs = lease.inputs.clone().expect("has inputs");
    let pieces = inputs.files.iter().map(|file| file.pieces.len());
    assert_eq!(pieces.sum::<usize>(), inputs.parts.len() + 1, "no more");
}

#[tokio::test]
async fn files_that_are_written_in_turns_are_put_together() {
    let service = Service::start_with(|config| config.upload.part_bytes = 16).await;
    let subject = service.subject("Ada").await;
    let (one, two) = (b"abcdefghijklmnop", b"0123456789");
    let files = [
        file("poses.json", one),
        file("empty", b""),
        file("two", two),
    ];
    let name = service.open_upload(&subject.name, &files).await;
    let name = name.expect("is opened").name;
    let mut turns = Vec::new();
    for at in 0..10 {
        turns.push(chunk(&name, "poses.json", at, &one[at as usize..][..1]));
        turns.push(chunk(&name, "two", at, &two[at as usize..][..1]));
    }
    for turn in turns.chunks(3) {
        service.write(turn.to_vec()).await.expect("writes");
    }
    let rest = vec![chunk(&name, "poses.json", 10, &one[10..])];
    service.write(rest).await.expect("writes");
    service.finish(&name).await.expect("is complete");
    let lease = service.ingest_lease().await;
    for file in &files {
        assert_eq!(service.ingested(&lease, &file.path), file.bytes);
    }
}

#[tokio::test]
async fn an_upload_that_an_earlier_version_began_goes_on() {
    let service = Service::start().await;
    let subject = service.subject("Ada").await;
    let files = [file("poses.json", b"{}"), file("video.mp4", b"0123456789")];
    let name = service.open_upload(&subject.name, &files).await;
    let name = name.expect("is opened").name;
    let upload = id(&name);
    // As the step of the schema leaves it: files of the folder are parts, and bytes after the committed ones do not count.
    for (number, path, content, committed, sha256) in [
        (1, "poses.json", &b"{}"[..], 2, files[0].sha256.clone()),
        (2, "video.mp4", &b"0123garbage"[..], 4, String::new()),
    ] {
        let key = format!("uploads/{upload}/{path}");
        service.put(&key, content).await;
        for statement in [
            format!(
                "UPDATE capture_files SET committed = {committed}
                 WHERE capture = '{upload}' AND path = '{path}'"
            ),
            format!(
                "INSERT INTO upload_parts (capture, writer, number, key, bytes, sha256)
                 VALUES ('{upload}', 0, {number}, '{key}', {committed}, '{sha256}')"
            ),
            format!(
                "INSERT INTO upload_pieces (capture, path, start, bytes, writer, number, part_start)
                 VALUES ('{upload}', '{path}', 0, {committed}, 0, {number}, 0)"
            ),
        ] {
            service.database.run(&statement).await;
        }
    }
    let found = service.get_upload(&name).await.expect("is there");
    assert_eq!(found.committed_bytes, 6);
    service.collect(false, true).await;
    let rest = vec![chunk(&name, "video.mp4", 4, b"456789")];
    service.write(rest).await.expect("goes on");
    service.finish(&name).await.expect("is complete");
    let lease = service.ingest_lease().await;
    assert_eq!(service.ingested(&lease, "video.mp4"), b"0123456789");
    assert_eq!(service.ingested(&lease, "poses.json"), b"{}");
}
