//! What pages ask of the database: the number of statements does not grow with people, models and jobs.

use super::stage::Stage;
use crate::support::{ask, id, listen};
use yoto_proto::v1::{Model, Subject};

/// People, and models.
const MANY: usize = 50;
/// People in the model whose page is looked at.
const TOGETHER: usize = 6;
/// Most statements of a page.
const MOST: u32 = 8;

/// The statements that a page has sent, as its header tells.
fn statements(head: &str) -> u32 {
    let (_, rest) = head.split_once("server-timing:").expect("tells its cost");
    let (_, rest) = rest.split_once("desc=\"").expect("has words");
    let (number, _) = rest.split_once(" statements").expect("has a number");
    number.parse().expect("is a number")
}

/// A service with as many people and models, each of a person's own; the first model has several, checkpoints, trainings,
/// renders and exports.
async fn crowded() -> (Stage, Vec<Subject>, Vec<Model>) {
    let stage = Stage::set().await;
    let service = &stage.service;
    let mut people = Vec::new();
    for number in 0..MANY {
        people.push(service.ready_subject(&format!("person {number}")).await);
    }
    let mut model = stage.model.clone();
    for person in people.iter().take(TOGETHER) {
        model = service.joined(model, person).await;
    }
    let mut models = vec![model];
    for person in &people {
        let model = service.model(&format!("of {}", person.display_name)).await;
        models.push(service.joined(model, person).await);
    }
    for model in models.iter().take(12) {
        service.train(model).await;
    }
    stage.export("page.html", b"<!doctype html>").await;
    (stage, people, models)
}

#[tokio::test]
async fn a_page_sends_few_statements_however_many_people_there_are() {
    let (stage, people, models) = crowded().await;
    let (address, serving) = listen(&stage.service).await;
    let model = format!("/models/{}", id(&models[0].name));
    let pages = [
        "/".to_owned(),
        "/people".to_owned(),
        format!("/people/{}", id(&people[0].name)),
        "/models".to_owned(),
        format!("{model}/report.html"),
        model,
        format!(
            "/compare?a={}&b={}",
            id(&models[0].name),
            id(&models[1].name)
        ),
        "/jobs".to_owned(),
        format!("/{}", stage.running),
        format!("/{}", stage.render),
        "/workers".to_owned(),
        "/service".to_owned(),
    ];
    let mut over = Vec::new();
    for page in &pages {
        let (status, head, body) = ask(address, "GET", page).await;
        assert_eq!(status, 200, "{page}: {body}");
        let sent = statements(&head);
        println!("{sent:4} {page}");
        if sent > MOST {
            over.push(format!("{page}: {sent}"));
        }
    }
    assert!(over.is_empty(), "more than {MOST} statements: {over:?}");
    serving.abort();
}
