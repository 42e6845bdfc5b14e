//! What pages ask of the database: the number of statements does not grow with people, models, jobs and workers.

use super::crowd::Crowd;
use crate::support::{ask, id, listen};

/// Most statements of a page.
const MOST: u32 = 8;

/// The statements that a page has sent, as its header tells.
fn statements(head: &str) -> u32 {
    let (_, rest) = head.split_once("server-timing:").expect("tells its cost");
    let (_, rest) = rest.split_once("desc=\"").expect("has words");
    let (number, _) = rest.split_once(" statements").expect("has a number");
    number.parse().expect("is a number")
}

#[tokio::test]
async fn a_page_sends_few_statements_however_many_people_there_are() {
    let crowd = Crowd::gathered().await;
    let (stage, people, models) = (&crowd.stage, &crowd.people, &crowd.models);
    let (address, serving) = listen(&stage.service).await;
    let model = format!("/models/{}", id(&models[0].name));
    let (one, other) = (id(&models[0].name), id(&models[1].name));
    let compared = format!("/compare?one={one}&other={other}");
    // Each page, and how often what is many shows on it.
    let pages = [
        ("/".to_owned(), "class=\"panel\"", 6),
        ("/people".to_owned(), "class=\"card\"", 51),
        (
            format!("/people/{}", id(&people[0].name)),
            "view coverage",
            2,
        ),
        ("/models".to_owned(), "<th scope=\"row\">", 50),
        (format!("{model}/report.html"), "Consent: ", 12),
        (model, "class=\"card\"", 7),
        (compared, "of person ", 100),
        ("/jobs".to_owned(), "<th scope=\"row\">", 50),
        (format!("/{}", stage.running), "class=\"chart\"", 2),
        (format!("/{}", stage.render), "000000.png", 1),
        (format!("/{}", crowd.waiting), "ahead of it", 1),
        (format!("/{}", crowd.put_back), "000000.png", 1),
        ("/workers".to_owned(), "training of ", 5),
        ("/service".to_owned(), "Used by the tenant", 1),
    ];
    let mut over = Vec::new();
    for (page, shown, least) in &pages {
        let (status, head, body) = ask(address, "GET", page).await;
        assert_eq!(status, 200, "{page}: {body}");
        let times = body.matches(shown).count();
        assert!(times >= *least, "{page} has {shown} {times} times: {body}");
        let sent = statements(&head);
        println!("{sent:4} {page}");
        if sent > MOST {
            over.push(format!("{page}: {sent}"));
        }
    }
    assert!(over.is_empty(), "more than {MOST} statements: {over:?}");
    serving.abort();
}
