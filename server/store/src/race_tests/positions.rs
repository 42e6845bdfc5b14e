//! Rows that are committed after rows with later positions.

use super::*;
use crate::scripts::{jobs, subjects};

#[tokio::test]
async fn a_job_that_is_committed_late_and_ends_at_once_is_found() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    let (own, first, second) = (&arena.own, &arena.pair.first, &arena.pair.second);
    let (ours, other) = (arena.model().await, arena.model().await);
    let mut late = first.db.write().await.expect("begins");
    let slow = jobs::insert(&mut late, own, Arena::training(&ours)).await;
    let slow = slow.expect("is queued");
    let quick = second.create_job(own, Arena::training(&other), None).await;
    let quick = id(&quick.expect("is queued").name);
    let read = second.job_versions(own, None).await.expect("reads");
    assert_eq!(ids(&read.jobs), std::slice::from_ref(&quick));
    late.commit().await.expect("commits");
    let cancelled = first.cancel_job(own, &slow, None).await;
    cancelled.expect("ends");
    let next = second.job_versions(own, Some(read.newest)).await;
    assert_eq!(ids(&next.expect("reads").jobs), [slow, quick]);
}

fn ids(jobs: &[JobVersion]) -> Vec<String> {
    jobs.iter().map(|it| it.id.clone()).collect()
}

/// A list from the oldest on may pass over a row that nobody was told of when the list began; the next list has it.
#[tokio::test]
async fn a_list_has_each_row_that_was_acknowledged_before_it_began() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    let (own, first, second) = (&arena.own, &arena.pair.first, &arena.pair.second);
    let mut late = first.db.write().await.expect("begins");
    let slow = subjects::create(&mut late, own, ada(), None).await;
    let slow = slow.expect("is created").name;
    let quick = arena.subject().await;
    let page = |after| Page { limit: 1, after };
    let listed = second.subjects(own, page(None)).await.expect("lists");
    assert_eq!(listed[0].item.name, format!("subjects/{quick}"));
    late.commit().await.expect("commits");
    let rest = second.subjects(own, page(Some(listed[0].position))).await;
    assert!(rest.expect("lists").is_empty());
    let listed = second.subjects(own, page(None)).await.expect("lists");
    assert_eq!(listed[0].item.name, slow);
}
