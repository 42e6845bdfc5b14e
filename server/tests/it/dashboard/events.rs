//! Events of pages: they tell changes, go on where a reader was, and end with the service.

use super::stage::Stage;
use crate::support::{Open, ask, id, listen};
use yoto_proto::v1::job;

/// The id of the last event in `text`.
fn last_id(text: &str) -> String {
    let mut ids = text.lines().filter_map(|it| it.strip_prefix("id: "));
    ids.next_back().expect("an id").to_owned()
}

#[tokio::test]
async fn a_reader_of_one_job_goes_on_after_what_it_has_seen() {
    let stage = Stage::set().await;
    let (address, serving) = listen(&stage.service).await;
    let path = format!("/events?job={}", id(&stage.running));
    let mut first = Open::get(address, &path, "").await;
    let seen = first.until("event: change").await;
    assert!(seen.contains("content-type: text/event-stream"), "{seen}");
    assert!(
        seen.contains("event: hello") && seen.contains("\"state\":\"RUNNING\""),
        "{seen}"
    );
    stage.report(40).await;
    let seen = first.until("\"fraction\":0.4").await;
    let last = last_id(&seen);
    drop(first);

    // Nothing is told again, and a change in the gap is not lost.
    let mut second = Open::get(address, &path, &format!("Last-Event-ID: {last}\r\n")).await;
    second.until("event: hello").await;
    stage.report(50).await;
    let seen = second.until("event: change").await;
    assert!(seen.contains("\"fraction\":0.5"), "{seen}");
    drop(second);
    stage.report(60).await;
    let mut third = Open::get(address, &format!("{path}&after={last}"), "").await;
    let seen = third.until("event: change").await;
    assert!(seen.contains("\"fraction\":0.6"), "{seen}");
    serving.abort();
}

#[tokio::test]
async fn a_reader_of_all_jobs_hears_nothing_again_unless_something_has_changed() {
    let stage = Stage::set().await;
    let (address, serving) = listen(&stage.service).await;
    let mut first = Open::get(address, "/events", "").await;
    let seen = first.until("event: change").await;
    assert!(
        seen.contains(&stage.running) && !seen.contains(&stage.failed),
        "{seen}"
    );
    let last = last_id(&seen);
    drop(first);

    let header = format!("Last-Event-ID: {last}\r\n");
    let model = format!("/events?model={}", id(&stage.model.name));
    for path in ["/events", &model] {
        let mut again = Open::get(address, path, &header).await;
        again.until("event: hello").await;
        let queued = stage.service.train(&stage.model).await.name;
        let seen = again.until("event: change").await;
        assert!(seen.contains(&queued), "{seen}");
        assert!(
            !seen.contains(&stage.running),
            "{path} tells it again: {seen}"
        );
        stage
            .service
            .jobs()
            .cancel_job(yoto_proto::v1::CancelJobRequest {
                name: queued.clone(),
                request_id: String::new(),
            })
            .await
            .expect("is cancelled");
        assert_eq!(
            stage.service.get_job(&queued).await.state(),
            job::State::Cancelled
        );
        let seen = again.until("CANCELLED").await;
        assert_ne!(last_id(&seen), last);
        // The newest job is another one now, so an old reader hears all that is open.
        let mut old = Open::get(address, path, &header).await;
        let seen = old.until("event: change").await;
        assert!(seen.contains(&stage.running), "{seen}");
        if path == "/events" {
            // Back to a state that the second pass knows.
            let delete = yoto_proto::v1::DeleteJobRequest {
                name: queued,
                ..<_>::default()
            };
            stage
                .service
                .jobs()
                .delete_job(delete)
                .await
                .expect("is deleted");
        }
    }
    serving.abort();
}

#[tokio::test]
async fn a_page_of_an_ended_job_stays_connected_until_the_service_ends() {
    let stage = Stage::set().await;
    let (address, serving) = listen(&stage.service).await;
    let path = format!("/events?job={}", id(&stage.failed));
    let mut open = Open::get(address, &path, "").await;
    let seen = open.until("event: change").await;
    assert!(seen.contains("FAILED"), "{seen}");
    assert_eq!(ask(address, "GET", "/healthz").await.0, 200);
    stage.service.stop().await;
    assert!(open.ended().await);
    serving.abort();
}
