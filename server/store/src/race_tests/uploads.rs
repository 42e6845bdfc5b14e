//! Writers, ends and deletions of uploads that meet.

use super::*;

/// Bytes of the only file.
const BYTES: u64 = 10;

impl Arena {
    /// Opens an upload of one file.
    async fn upload(&self, subject: &str) -> String {
        let file = UploadedFile {
            path: "poses.json".into(),
            bytes: BYTES,
            sha256: String::new(),
        };
        let new = NewUpload {
            subject_id: subject.to_owned(),
            files: vec![file],
        };
        let upload = self.pair.first.create_upload(&self.own, new, None).await;
        upload.expect("opens")
    }

    /// Commits the bytes from `from` to `to` as part `number` of `writer`.
    async fn commit(
        &self,
        store: &Store,
        upload: &str,
        (writer, number): (u64, u64),
        (from, to): (u64, u64),
    ) -> Result<(), StoreError> {
        let id = PartId { writer, number };
        let part = NewPart {
            id,
            object: ObjectRef {
                bytes: to - from,
                ..object(&format!("{writer}-{number}"))
            },
            pieces: vec![NewPiece {
                path: "poses.json".into(),
                from,
                to,
            }],
            replaces: None,
        };
        store.commit_part(&self.own, upload, &part).await
    }

    async fn take_over(&self, store: &Store, upload: &str) -> Result<u64, StoreError> {
        store.take_over_upload(&self.own, upload).await
    }

    /// Committed bytes, which are those of the pieces, without gaps, in the order of the parts.
    async fn committed(&self, upload: &str) -> u64 {
        let store = &self.pair.second;
        let state = store.upload(&self.own, upload).await.expect("is there");
        let parts = store.upload_parts(&self.own, upload).await;
        let parts = parts.expect("is there");
        let mut next = 0;
        for piece in parts.iter().flat_map(|it| &it.part.pieces) {
            assert_eq!(piece.offset, next, "{parts:?}");
            next += piece.bytes;
        }
        assert_eq!(state.files[0].committed, next);
        next
    }
}

#[tokio::test]
async fn one_of_two_writers_of_an_upload_is_accepted() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    let subject = arena.subject().await;
    for _ in 0..ROUNDS {
        let upload = arena.upload(&subject).await;
        let write = async |store: &Store, to| {
            let writer = arena.take_over(store, &upload).await.expect("is open");
            arena.commit(store, &upload, (writer, 0), (0, to)).await
        };
        let (one, two) = tokio::join!(
            write(&arena.pair.first, 4),
            write(&arena.pair.second, BYTES)
        );
        let expected = if one.is_ok() { 4 } else { BYTES };
        assert!(one.is_ok() != two.is_ok(), "{one:?} {two:?}");
        let refused = one.and(two).expect_err("one of them");
        let late = [ErrorReason::UploadOffset, ErrorReason::UploadTakenOver];
        assert!(
            reason(&refused).is_some_and(|it| late.contains(&it)),
            "{refused}"
        );
        assert_eq!(arena.committed(&upload).await, expected);
    }
}

#[tokio::test]
async fn a_writer_goes_on_until_another_one_takes_over() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    let subject = arena.subject().await;
    for _ in 0..ROUNDS {
        let upload = arena.upload(&subject).await;
        let first = &arena.pair.first;
        let writer = arena.take_over(first, &upload).await.expect("is open");
        let writes = async {
            let mut done = 0;
            while done < BYTES {
                let bytes = (done, done + 1);
                match arena.commit(first, &upload, (writer, done), bytes).await {
                    Ok(()) => done += 1,
                    Err(error) => {
                        assert_eq!(reason(&error), Some(ErrorReason::UploadTakenOver));
                        break;
                    }
                }
            }
            done
        };
        let goes_on = async {
            let second = &arena.pair.second;
            let writer = arena.take_over(second, &upload).await.expect("is open");
            // What it finds is final: nobody else commits.
            let found = arena.committed(&upload).await;
            if found < BYTES {
                let rest = (found, BYTES);
                let committed = arena.commit(second, &upload, (writer, 0), rest).await;
                committed.expect("is the newest");
            }
            let finished = second
                .finish_upload(&arena.own, &upload, writer, None)
                .await;
            finished.expect("is complete");
            found
        };
        let (done, found) = tokio::join!(writes, goes_on);
        assert_eq!(done, found, "what was acknowledged is what was found");
        assert_eq!(arena.committed(&upload).await, BYTES);
    }
}

#[tokio::test]
async fn one_of_two_ends_of_an_upload_that_found_other_bytes_is_refused() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    let subject = arena.subject().await;
    for _ in 0..ROUNDS {
        let upload = arena.upload(&subject).await;
        let first = &arena.pair.first;
        let writer = arena.take_over(first, &upload).await.expect("is open");
        let all = arena.commit(first, &upload, (writer, 0), (0, BYTES)).await;
        all.expect("is the newest");
        // The second one finds the file damaged, and starts it anew.
        let restart = async {
            let second = &arena.pair.second;
            let writer = arena.take_over(second, &upload).await?;
            let paths = ["poses.json".to_owned()];
            second
                .restart_files(&arena.own, &upload, writer, &paths)
                .await
        };
        let (finished, restarted) = tokio::join!(
            first.finish_upload(&arena.own, &upload, writer, None),
            restart
        );
        restarted.expect("changes the upload, or nothing");
        match finished {
            Ok(_) => assert_eq!(arena.committed(&upload).await, BYTES),
            Err(error) => {
                assert_eq!(
                    reason(&error),
                    Some(ErrorReason::UploadTakenOver),
                    "{error}"
                );
                assert_eq!(arena.committed(&upload).await, 0);
            }
        }
    }
}

#[tokio::test]
async fn an_upload_that_is_deleted_while_it_is_written_leaves_no_rows() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    for _ in 0..ROUNDS {
        let subject = arena.subject().await;
        let upload = arena.upload(&subject).await;
        let first = &arena.pair.first;
        let writer = arena.take_over(first, &upload).await.expect("is open");
        let (written, deleted) = tokio::join!(
            arena.commit(first, &upload, (writer, 0), (0, 4)),
            arena
                .pair
                .second
                .delete(&arena.own, Target::Capture(&upload), "", None),
        );
        deleted.expect("nobody uses it");
        if let Err(error) = written {
            assert!(matches!(error, StoreError::NotFound { .. }), "{error}");
        }
        let mut tx = first.db.read().await.expect("reads");
        for table in ["upload_parts", "upload_pieces"] {
            let rows = sql(format!(
                "SELECT count(*) AS rows FROM {table} WHERE capture = $1"
            ))
            .bind(&upload)
            .one(&mut tx, "counting")
            .await
            .expect("counts");
            assert_eq!(rows.number::<u64>("rows").expect("a number"), 0, "{table}");
        }
    }
}
