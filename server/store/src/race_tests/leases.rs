//! Leases, cancels, ends and losses that meet.

use super::*;

#[tokio::test]
async fn each_job_is_leased_once() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    for _ in 0..ROUNDS {
        let mut jobs = BTreeSet::new();
        let mut workers = Vec::new();
        for _ in 0..6 {
            jobs.insert(arena.train(&arena.model().await).await);
            workers.push(arena.worker(&[JobKind::Train]).await);
        }
        let stores = [&arena.pair.first, &arena.pair.second].into_iter().cycle();
        let leases = stores
            .zip(&workers)
            .map(|(store, it)| arena.lease(store, it));
        let leased = join_all(leases).await;
        let leased: Vec<LeaseKey> = leased.into_iter().flatten().collect();
        let of: BTreeSet<String> = leased.iter().map(|it| it.job_id.clone()).collect();
        assert_eq!(
            (leased.len(), &of),
            (6, &jobs),
            "each worker has another job"
        );
        for lease in &leased {
            let job = arena
                .pair
                .first
                .job_history(&arena.own, &lease.job_id)
                .await;
            assert_eq!(job.expect("is there").attempts.len(), 1);
            let cancel = arena
                .pair
                .second
                .heartbeat(&arena.own, lease, None, LEASE_SECONDS)
                .await;
            cancel.expect("the lease is current");
        }
    }
}

#[tokio::test]
async fn a_job_that_is_being_leased_is_passed_over() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    let worker = arena.worker(&[JobKind::Train]).await;
    let first = arena.train(&arena.model().await).await;
    let second = arena.train(&arena.model().await).await;
    let mut tx = arena.pair.first.db.write().await.expect("begins");
    let claimed = queue::next(&mut tx, &worker).await.expect("reads");
    assert_eq!(claimed.map(|it| it.id), Some(first));
    let lease = arena.lease(&arena.pair.second, &worker).await;
    assert_eq!(lease.map(|it| it.job_id), Some(second));
}

#[tokio::test]
async fn a_transaction_that_was_rolled_back_for_another_one_is_run_again() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    let people = [arena.subject().await, arena.subject().await];
    let met = Barrier::new(2);
    let rename = async |store: &Store, order: [&String; 2]| {
        let first_try = AtomicBool::new(true);
        let done: Result<(), StoreError> = transaction!(store, |tx| async {
            for (number, person) in order.iter().enumerate() {
                sql("UPDATE subjects SET display_name = 'Eve' WHERE id = $1")
                    .bind(*person)
                    .execute(tx, "renaming a person")
                    .await?;
                if number == 0 && first_try.swap(false, Ordering::Relaxed) {
                    met.wait().await;
                }
            }
            Ok(())
        });
        done.expect("is run again");
    };
    let [one, two] = &people;
    tokio::join!(
        rename(&arena.pair.first, [one, two]),
        rename(&arena.pair.second, [two, one]),
    );
}

#[tokio::test]
async fn a_model_has_one_trainer() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    let workers = [
        arena.worker(&[JobKind::Train]).await,
        arena.worker(&[JobKind::Train]).await,
    ];
    // While no lease runs, leases follow each other anyway: each starts the lease clock.
    arena.train(&arena.model().await).await;
    let busy = arena.worker(&[JobKind::Train]).await;
    let other = arena.lease(&arena.pair.first, &busy).await;
    other.expect("the job waits");
    for _ in 0..ROUNDS {
        let model = arena.model().await;
        let (first, second) = (arena.train(&model).await, arena.train(&model).await);
        let (one, two) = tokio::join!(
            arena.lease(&arena.pair.first, &workers[0]),
            arena.lease(&arena.pair.second, &workers[1]),
        );
        assert!(one.is_some() != two.is_some(), "{one:?} {two:?}");
        for job in [first, second] {
            let cancelled = arena.pair.first.cancel_job(&arena.own, &job, None).await;
            cancelled.expect("is cancelled");
        }
        let lease = one.or(two).expect("one of them");
        let ended = arena
            .pair
            .first
            .end_job(&arena.own, &lease, Ending::Cancelled)
            .await;
        ended.expect("ends");
    }
}

#[tokio::test]
async fn a_cancel_and_a_lease_agree() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    let worker = arena.worker(&[JobKind::Train]).await;
    for _ in 0..ROUNDS {
        let job = arena.train(&arena.model().await).await;
        let (lease, cancelled) = tokio::join!(
            arena.lease(&arena.pair.first, &worker),
            arena.pair.second.cancel_job(&arena.own, &job, None),
        );
        cancelled.expect("answers");
        let after = arena
            .pair
            .first
            .job(&arena.own, &job)
            .await
            .expect("is there");
        match lease {
            None => assert_eq!(after.state(), job::State::Cancelled),
            Some(lease) => {
                assert!(after.cancel_requested, "{after:?}");
                let told = arena
                    .pair
                    .second
                    .heartbeat(&arena.own, &lease, None, LEASE_SECONDS)
                    .await;
                assert!(
                    told.expect("the lease is current"),
                    "the worker learns of it"
                );
                let ended = arena
                    .pair
                    .second
                    .end_job(&arena.own, &lease, Ending::Cancelled)
                    .await;
                ended.expect("ends");
            }
        }
    }
}

#[tokio::test]
async fn one_of_two_ends_is_accepted() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    let worker = arena.worker(&[JobKind::Train]).await;
    for _ in 0..ROUNDS {
        arena.train(&arena.model().await).await;
        let lease = arena
            .lease(&arena.pair.first, &worker)
            .await
            .expect("a job waits");
        let failed = Ending::Failed(v1::JobError::default());
        let (one, two) = tokio::join!(
            arena.end(
                &arena.pair.first,
                &lease,
                job_result::Kind::Train(TrainResult::default())
            ),
            arena.pair.second.end_job(&arena.own, &lease, failed),
        );
        assert!(one.is_ok() != two.is_ok(), "{one:?} {two:?}");
        let refused = one.and(two).expect_err("one of them");
        assert!(
            matches!(refused, StoreError::StaleLease { .. }),
            "{refused}"
        );
    }
}

#[tokio::test]
async fn a_lost_worker_is_counted_once() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    let job = arena.train(&arena.model().await).await;
    for round in 1..=3 {
        let worker = arena.worker(&[JobKind::Train]).await;
        arena
            .lease(&arena.pair.first, &worker)
            .await
            .expect("the job waits");
        let mut found = 0;
        // In ticks, so that the time is no outage.
        for _ in 0..6 {
            arena.clock.advance(LEASE_SECONDS / 4.0);
            let tick = |store| Store::tick(store, 9, LEASE_SECONDS);
            let (one, two) = tokio::join!(tick(&arena.pair.first), tick(&arena.pair.second));
            found += one.expect("ticks").len() + two.expect("ticks").len();
        }
        assert_eq!(found, 1);
        let job = arena
            .pair
            .first
            .job(&arena.own, &job)
            .await
            .expect("is there");
        assert_eq!((job.state(), job.lost_workers), (job::State::Queued, round));
    }
}
