//! Pictures of a render that several workers draw, and the checkpoint that it uses.

use super::*;

#[tokio::test]
async fn each_picture_is_drawn_by_one_worker() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    const PICTURES: u32 = 64;
    let (subject, model) = (arena.ready().await, arena.model().await);
    let added = arena
        .pair
        .first
        .add_identity(&arena.own, &model, &subject, None)
        .await;
    added.expect("gets a slot");
    let kinds = [JobKind::Train, JobKind::Render];
    let workers = [arena.worker(&kinds).await, arena.worker(&kinds).await];
    arena.train(&model).await;
    let lease = arena
        .lease(&arena.pair.first, &workers[0])
        .await
        .expect("it waits");
    arena
        .publish(&arena.pair.first, &lease, 1)
        .await
        .expect("publishes");
    let result = job_result::Kind::Train(TrainResult::default());
    arena
        .end(&arena.pair.first, &lease, result)
        .await
        .expect("ends");
    for _ in 0..ROUNDS.min(4) {
        let job = arena
            .pair
            .first
            .create_job(&arena.own, render(&model, &subject, ""), None)
            .await;
        job.expect("is queued");
        let runs = arena
            .lease(&arena.pair.first, &workers[0])
            .await
            .expect("it waits");
        let own = &arena.own;
        let take = |store, lease, drawn| Store::take_range(store, own, lease, PICTURES, drawn);
        // A copy of the first call divides the render at the same time.
        let (one, copy) = tokio::join!(
            take(&arena.pair.first, &runs, None),
            take(&arena.pair.second, &runs, None)
        );
        let mut first = one.expect("takes").range;
        assert_eq!(
            copy.expect("takes").range,
            first,
            "a copy gets the same range"
        );
        let helps = arena
            .lease_or_help(&arena.pair.second, &workers[1], true)
            .await;
        let helps = helps.expect("there is something to draw");
        let mut second = take(&arena.pair.second, &helps, None)
            .await
            .expect("takes")
            .range;
        let mut drawn = BTreeMap::new();
        while first.is_some() || second.is_some() {
            for range in [&first, &second].into_iter().flatten() {
                let earlier = drawn.insert(range.first, range.count);
                assert_eq!(earlier, None, "{range:?} is drawn twice");
            }
            let (one, two) = tokio::join!(
                take(&arena.pair.first, &runs, first.as_ref().map(|it| it.first)),
                take(
                    &arena.pair.second,
                    &helps,
                    second.as_ref().map(|it| it.first)
                ),
            );
            (first, second) = (one.expect("takes").range, two.expect("takes").range);
        }
        assert_eq!(drawn.values().sum::<u32>(), PICTURES);
        let result = job_result::Kind::Render(v1::RenderResult::default());
        arena
            .end(&arena.pair.first, &runs, result)
            .await
            .expect("ends");
    }
}

#[tokio::test]
async fn a_checkpoint_that_a_render_uses_is_kept() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    let (subject, model) = (arena.ready().await, arena.model().await);
    let added = arena
        .pair
        .first
        .add_identity(&arena.own, &model, &subject, None)
        .await;
    added.expect("gets a slot");
    let worker = arena.worker(&[JobKind::Train]).await;
    arena.train(&model).await;
    let lease = arena
        .lease(&arena.pair.first, &worker)
        .await
        .expect("it waits");
    arena
        .publish(&arena.pair.first, &lease, 1)
        .await
        .expect("publishes");
    for step in 1..=ROUNDS {
        let wanted = format!("models/{model}/checkpoints/{step}");
        let (published, queued) = tokio::join!(
            arena.publish(&arena.pair.first, &lease, step + 1),
            arena
                .pair
                .second
                .create_job(&arena.own, render(&model, &subject, &wanted), None),
        );
        published.expect("publishes");
        let all = arena.pair.first.checkpoints(&arena.own, &model, 99).await;
        let kept = all.expect("lists").iter().any(|it| it.step == step);
        match queued {
            Ok(_) => assert!(kept, "the render of step {step} has no checkpoint"),
            Err(error) => assert_eq!(reason(&error), Some(ErrorReason::NoCheckpoint), "{error}"),
        }
    }
}
