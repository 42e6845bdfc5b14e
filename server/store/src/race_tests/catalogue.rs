//! Creations, deletions, repeated requests and uploads that meet.

use super::*;

#[tokio::test]
async fn a_model_is_deleted_or_trained() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    for _ in 0..ROUNDS {
        let model = arena.model().await;
        let (deleted, queued) = tokio::join!(
            arena
                .pair
                .first
                .delete(&arena.own, Target::Model(&model), "", None),
            arena
                .pair
                .second
                .create_job(&arena.own, Arena::training(&model), None),
        );
        match (deleted, queued) {
            (Ok(_), Err(StoreError::NotFound { .. })) => {}
            (Err(error), Ok(_)) => assert_eq!(reason(&error), Some(ErrorReason::ModelBusy)),
            other => panic!("{other:?}"),
        }
    }
}

#[tokio::test]
async fn a_person_is_deleted_or_uploaded() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    for _ in 0..ROUNDS {
        let subject = arena.subject().await;
        let new = NewUpload {
            subject_id: subject.clone(),
            files: Vec::new(),
        };
        let (deleted, opened) = tokio::join!(
            arena
                .pair
                .first
                .delete(&arena.own, Target::Subject(&subject), "", None),
            arena.pair.second.create_upload(&arena.own, new, None),
        );
        let captures = deleted.expect("nobody uses it").captures;
        match opened {
            Ok(_) => assert_eq!(captures, 1, "the upload goes with its person"),
            Err(error) => assert!(matches!(error, StoreError::NotFound { .. }), "{error}"),
        }
    }
}

#[tokio::test]
async fn a_repeated_request_is_answered_once() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    for round in 0..ROUNDS {
        let request = || {
            Some(RequestKey {
                method: "CreateSubject",
                request_id: format!("{round}"),
                body_sha256: String::new(),
            })
        };
        let (one, two) = tokio::join!(
            arena
                .pair
                .first
                .create_subject(&arena.own, ada(), request()),
            arena
                .pair
                .second
                .create_subject(&arena.own, ada(), request()),
        );
        assert_eq!(one.expect("answers"), two.expect("answers"));
    }
    let page = Page {
        limit: 99,
        after: None,
    };
    let all = arena
        .pair
        .first
        .subjects(&arena.own, page)
        .await
        .expect("lists");
    assert_eq!(all.len() as u64, ROUNDS);
}

#[tokio::test]
async fn each_person_of_a_model_has_a_slot() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    let people = [arena.ready().await, arena.ready().await];
    for _ in 0..ROUNDS {
        let model = arena.model().await;
        let add = |store, person| Store::add_identity(store, &arena.own, &model, person, None);
        let (one, two, again) = tokio::join!(
            add(&arena.pair.first, &people[0]),
            add(&arena.pair.second, &people[1]),
            add(&arena.pair.second, &people[0]),
        );
        let (one, two) = (one.expect("a slot").slot, two.expect("a slot").slot);
        assert_eq!(again.expect("the same slot").slot, one);
        assert_eq!(BTreeSet::from([one, two]), BTreeSet::from([0, 1]));
    }
}
