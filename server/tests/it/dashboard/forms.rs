//! What the forms of pages change, and who may send them.

use super::stage::{HOSTILE, Stage};
use crate::support::{Service, ask, ask_with, id, listen};
use std::net::SocketAddr;
use yoto_proto::v1::render_spec::What;
use yoto_proto::v1::{JobKind, ListModelsRequest, job, job_spec};

/// The headers of a form.
pub(crate) const FORM: &str =
    "Content-Type: application/x-www-form-urlencoded\r\nSec-Fetch-Site: same-origin\r\n";

/// The value of the first field of this name in a page; empty without one.
async fn field(address: SocketAddr, path: &str, name: &str) -> String {
    let (_, _, page) = ask(address, "GET", path).await;
    field_in(&page, name).to_owned()
}

/// The value of a form's field in a page; empty without the field.
pub(crate) fn field_in<'a>(page: &'a str, name: &str) -> &'a str {
    let rest = page.split(&format!("name=\"{name}\" value=\"")).nth(1);
    rest.and_then(|it| it.split('"').next()).unwrap_or_default()
}

/// The token of the forms of a page; empty without a form.
pub(crate) async fn token(address: SocketAddr, path: &str) -> String {
    field(address, path, "token").await
}

/// Status and place of the answer to a form.
async fn send(address: SocketAddr, path: &str, body: &str) -> (u16, String) {
    let (status, head, _) = ask_with(address, "POST", path, FORM, body).await;
    let place = head.lines().find_map(|it| it.strip_prefix("location: "));
    (status, place.unwrap_or_default().to_owned())
}

#[tokio::test]
async fn a_form_without_the_token_of_the_service_changes_nothing() {
    let stage = Stage::set().await;
    let (address, serving) = listen(&stage.service).await;
    let page = format!("/{}", stage.running);
    let cancel = format!("{page}/cancel");
    let token = token(address, &page).await;
    assert_eq!(token.len(), 64);
    let good = format!("token={token}");
    let form = "Content-Type: application/x-www-form-urlencoded\r\n";
    let foreign = format!("{form}Sec-Fetch-Site: cross-site\r\n");
    for (headers, body) in [
        (FORM, ""),
        (FORM, "token="),
        (FORM, "token=0000"),
        ("Content-Type: text/plain\r\n", good.as_str()),
        (&foreign, good.as_str()),
    ] {
        let (status, _, answer) = ask_with(address, "POST", &cancel, headers, body).await;
        assert_eq!(status, 403, "{headers} {body}: {answer}");
    }
    for path in [
        "/workers/cordon",
        "/workers/uncordon",
        &format!("/{}/retry", stage.failed),
    ] {
        assert_eq!(send(address, path, "worker=x").await.0, 403, "{path}");
    }
    assert!(!stage.service.get_job(&stage.running).await.cancel_requested);
    // The guard, and not something else, has refused it.
    assert_eq!(send(address, &cancel, &good).await, (303, page));
    assert!(stage.service.get_job(&stage.running).await.cancel_requested);
    serving.abort();
}

#[tokio::test]
async fn two_tabs_cancel_the_same_job() {
    let stage = Stage::set().await;
    let (address, serving) = listen(&stage.service).await;
    let page = format!("/{}", stage.running);
    let token = token(address, &page).await;
    for request in ["one", "one", "two"] {
        let body = format!("token={token}&request={request}");
        let (status, place) = send(address, &format!("{page}/cancel"), &body).await;
        assert_eq!((status, place.as_str()), (303, page.as_str()), "{request}");
    }
    let (_, _, shown) = ask(address, "GET", &page).await;
    assert!(
        shown.contains("It is asked to stop") && !shown.contains("Cancel the job"),
        "{shown}"
    );
    serving.abort();
}

#[tokio::test]
async fn a_failed_job_is_queued_again_once_per_form() {
    let stage = Stage::set().await;
    let (address, serving) = listen(&stage.service).await;
    let page = format!("/{}", stage.failed);
    let token = token(address, &page).await;
    let request = field(address, &page, "request").await;
    assert!(!request.is_empty());
    let body = format!("token={token}&request={request}");
    let retry = format!("{page}/retry");
    let (status, place) = send(address, &retry, &body).await;
    assert_eq!(status, 303);
    let job = stage.service.get_job(place.trim_start_matches('/')).await;
    assert_eq!(job.state(), job::State::Queued);
    assert_eq!(
        send(address, &retry, &body).await.1,
        place,
        "sent twice, asked once"
    );
    // A job that runs is not repeated, and the page says why.
    let running = format!("/{}/retry", stage.running);
    let refused = ask_with(address, "POST", &running, FORM, &format!("token={token}")).await;
    assert_eq!(refused.0, 409);
    assert!(refused.2.contains("only one that FAILED"), "{}", refused.2);
    serving.abort();
}

#[tokio::test]
async fn workers_are_cordoned_with_their_reason_and_released() {
    let stage = Stage::set().await;
    let (address, serving) = listen(&stage.service).await;
    let token = token(address, "/workers").await;
    let name = HOSTILE.replace('<', "%3C").replace('>', "%3E");
    let body = format!("token={token}&worker={name}&reason=a+%3Cb%3E");
    assert_eq!(
        send(address, "/workers/cordon", &body).await,
        (303, "/workers".into())
    );
    let (_, _, shown) = ask(address, "GET", "/workers").await;
    assert!(
        shown.contains("cordoned") && shown.contains("a &lt;b&gt;"),
        "{shown}"
    );
    let body = format!("token={token}&worker={name}");
    assert_eq!(send(address, "/workers/uncordon", &body).await.0, 303);
    let (_, _, shown) = ask(address, "GET", "/workers").await;
    assert!(!shown.contains("Give it jobs again"), "{shown}");
    let bad = format!("token={token}&worker=%00");
    assert_eq!(send(address, "/workers/cordon", &bad).await.0, 400);
    serving.abort();
}

#[tokio::test]
async fn a_form_of_an_open_page_outlasts_a_restart() {
    let service = Service::start().await;
    let subject = service.ready_subject("Ada").await;
    let job = service.train(&service.model_of(&subject).await).await.name;
    let (address, serving) = listen(&service).await;
    let before = token(address, &format!("/{job}")).await;
    serving.abort();
    let dir = service.stop().await;
    let service = Service::start_in(dir, |_| {}).await;
    let (address, serving) = listen(&service).await;
    let cancel = format!("/{job}/cancel");
    assert_eq!(
        send(address, &cancel, &format!("token={before}")).await.0,
        303
    );
    serving.abort();
}

#[tokio::test]
async fn a_training_and_a_player_are_ordered_from_the_page_of_their_model() {
    let stage = Stage::set().await;
    let (address, serving) = listen(&stage.service).await;
    let page = format!("/{}", stage.model.name);
    let token = token(address, &page).await;
    let train = format!("{page}/train");
    let (status, place) = send(address, &train, &format!("token={token}&minutes=7")).await;
    assert_eq!(status, 303);
    let job = stage.service.get_job(place.trim_start_matches('/')).await;
    let Some(job_spec::Kind::Train(spec)) = job.spec.and_then(|it| it.kind) else {
        panic!("{place} is no training");
    };
    assert_eq!(
        (spec.model, spec.seconds),
        (stage.model.name.clone(), 420.0)
    );
    for minutes in ["", "0", "-1", "1.5", "1e9"] {
        let body = format!("token={token}&minutes={minutes}");
        assert_eq!(send(address, &train, &body).await.0, 400, "{minutes}");
    }
    let player = format!("{page}/player");
    let body = format!("token={token}&subject={}", stage.subject.name);
    let (status, place) = send(address, &player, &body).await;
    assert_eq!(status, 303);
    let job = stage.service.get_job(place.trim_start_matches('/')).await;
    assert_eq!(job.kind(), JobKind::Export);
    let nobody = format!("token={token}&subject=%3Cb%3E");
    assert_eq!(send(address, &player, &nobody).await.0, 400);
    let film = format!("{page}/film");
    let rest = "driver=&azimuth=30&elevation=10&sweep=360&seconds=2";
    let body = format!(
        "token={token}&subject={}&size=256&{rest}",
        stage.subject.name
    );
    let (status, place) = send(address, &film, &body).await;
    assert_eq!(status, 303);
    let job = stage.service.get_job(place.trim_start_matches('/')).await;
    let Some(job_spec::Kind::Render(spec)) = job.spec.and_then(|it| it.kind) else {
        panic!("{place} is no render");
    };
    let Some(What::Scene(scene)) = spec.what else {
        panic!("{spec:?}");
    };
    assert_eq!((scene.width, scene.height, scene.seconds), (192, 256, 2.0));
    assert_eq!(scene.actors[0].subject, stage.subject.name);
    for bad in [
        "size=256&azimuth=x",
        "size=9999&azimuth=0",
        "size=256&azimuth=200",
    ] {
        let rest = "driver=&elevation=10&sweep=0&seconds=2";
        let body = format!("token={token}&subject={}&{bad}&{rest}", stage.subject.name);
        assert_eq!(send(address, &film, &body).await.0, 400, "{bad}");
    }
    assert_eq!(send(address, &train, "minutes=7").await.0, 403);
    serving.abort();
}

#[tokio::test]
async fn an_avatar_is_ordered_from_the_page_of_the_person() {
    let service = Service::start().await;
    let trained = service.trained().await;
    let subject = service.ready_subject("Eve").await;
    let (address, serving) = listen(&service).await;
    let page = format!("/people/{}", id(&subject.name));
    let token = token(address, &page).await;
    let make = format!("{page}/avatar");
    let body = format!("token={token}&request=one&model=&minutes=3");
    let (status, place) = send(address, &make, &body).await;
    assert_eq!(status, 303);
    let again = send(address, &make, &body).await;
    assert_eq!(
        again,
        (303, place.clone()),
        "a form that is sent twice is carried out once"
    );
    let job = service.get_job(place.trim_start_matches('/')).await;
    let Some(job_spec::Kind::Train(spec)) = job.spec.and_then(|it| it.kind) else {
        panic!("{place} is no training");
    };
    assert_eq!((spec.seconds, &*spec.only), (180.0, ""));
    let list = service
        .models()
        .list_models(ListModelsRequest::default())
        .await;
    let models = list.expect("lists").into_inner().models;
    let made: Vec<_> = models
        .iter()
        .filter(|it| it.display_name == "Eve")
        .collect();
    assert_eq!((made.len(), &*made[0].tier), (1, "splat"));
    assert_eq!(made[0].slots[0].subject, subject.name);

    // Bob joins what is trained already: only what is his is trained.
    let bob = service.ready_subject("Bob").await;
    let make = format!("/people/{}/avatar", id(&bob.name));
    let body = format!(
        "token={token}&request=two&model={}&minutes=1",
        trained.model.name
    );
    let (status, place) = send(address, &make, &body).await;
    assert_eq!(status, 303);
    let job = service.get_job(place.trim_start_matches('/')).await;
    let Some(job_spec::Kind::Train(spec)) = job.spec.and_then(|it| it.kind) else {
        panic!("{place} is no training");
    };
    assert_eq!((spec.model, spec.only), (trained.model.name, bob.name));
    for bad in [
        "minutes=0&model=",
        "minutes=x&model=",
        "minutes=1&model=models/none",
    ] {
        let status = send(address, &make, &format!("token={token}&{bad}"))
            .await
            .0;
        assert!(status == 400 || status == 404, "{bad}: {status}");
    }
    serving.abort();
}
