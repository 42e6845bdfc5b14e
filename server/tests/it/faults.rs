//! Injected faults: calls arrive several times, answers get lost, and the moments of a call come in order.

use crate::support::Service;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use tonic::Code;
use yoto_proto::v1::{CreateSubjectRequest, ListSubjectsRequest};
use yoto_server::faults::{Delivery, Faults, Moment};

/// The same delivery for each call, and all moments that were reached.
#[derive(Debug)]
struct Always {
    delivery: Delivery,
    moments: Mutex<Vec<(String, Moment)>>,
}

impl Always {
    fn new(times: u32, answered: bool) -> Arc<Self> {
        Self::with(Delivery {
            times,
            answered,
            ..Delivery::ONCE
        })
    }

    fn with(delivery: Delivery) -> Arc<Self> {
        Arc::new(Self {
            delivery,
            moments: Mutex::default(),
        })
    }

    fn moments(&self) -> Vec<(String, Moment)> {
        self.moments.lock().expect("no panic").clone()
    }
}

impl Faults for Always {
    fn reached(&self, call: &str, moment: Moment) {
        let mut moments = self.moments.lock().expect("no panic");
        moments.push((call.to_owned(), moment));
    }

    fn delivery(&self, _call: &str) -> Delivery {
        self.delivery
    }
}

async fn start(faults: &Arc<Always>) -> Service {
    let faults = Arc::clone(faults) as Arc<dyn Faults>;
    Service::start_with(|config| config.faults = Some(faults)).await
}

fn ada(request_id: &str) -> CreateSubjectRequest {
    CreateSubjectRequest {
        display_name: "Ada".into(),
        request_id: request_id.into(),
        ..<_>::default()
    }
}

async fn count(service: &Service) -> usize {
    let request = ListSubjectsRequest::default();
    let listed = service.subjects().list_subjects(request).await;
    listed.expect("lists").into_inner().subjects.len()
}

#[tokio::test]
async fn a_call_arrives_as_often_as_it_is_told() {
    let faults = Always::new(3, true);
    let service = start(&faults).await;
    let created = service.subjects().create_subject(ada("")).await;
    created.expect("the last answer arrives");
    assert_eq!(count(&service).await, 3, "without a request id");
    let created = service.subjects().create_subject(ada("once")).await;
    created.expect("the last answer arrives");
    assert_eq!(count(&service).await, 4, "with one");
}

#[tokio::test]
async fn a_lost_answer_is_that_of_a_call_that_was_carried_out() {
    let faults = Always::new(1, false);
    let service = start(&faults).await;
    let lost = service.subjects().create_subject(ada("")).await;
    let lost = lost.expect_err("the answer is lost");
    assert_eq!(lost.code(), Code::Unavailable);
    let moments = faults.moments();
    let expected = [
        Moment::BeforeCommit,
        Moment::AfterCommit,
        Moment::BeforeReply,
    ];
    let expected = expected.map(|moment| ("CreateSubject".to_owned(), moment));
    assert_eq!(moments, expected);
}

#[tokio::test]
async fn a_late_copy_arrives_after_the_answer() {
    let faults = Always::with(Delivery {
        late: Some(Duration::from_millis(20)),
        ..Delivery::ONCE
    });
    let service = start(&faults).await;
    let created = service.subjects().create_subject(ada("")).await;
    created.expect("the first copy is answered");
    let began = Instant::now();
    while count(&service).await < 2 {
        assert!(began.elapsed() < Duration::from_secs(10), "no late copy");
        tokio::task::yield_now().await;
    }
}
