//! The report of a model: one file that needs nothing else.

use super::links;
use super::stage::Stage;
use crate::support::{ask, listen};

#[tokio::test]
async fn a_report_has_everything_in_itself_and_nothing_that_others_wrote_is_markup() {
    let stage = Stage::set().await;
    let (address, serving) = listen(&stage.service).await;
    let path = format!("/{}/report.html", stage.model.name);
    let (status, head, body) = ask(address, "GET", &path).await;
    assert_eq!(status, 200, "{body}");
    assert!(head.contains("default-src 'none'"), "{head}");
    for other in ["'self'", "script-src", "unsafe"] {
        assert!(!head.contains(other), "{head}");
    }
    let links = links(&body);
    assert!(
        links.iter().all(|it| it.starts_with("data:image/")),
        "{links:?}"
    );
    let shown = |text: &str| assert!(body.contains(text), "no {text}: {body}");
    // The person's picture, "picture", and one of the render.
    shown("data:image/png;base64,cGljdHVyZQ==");
    let pictures = links
        .iter()
        .filter(|it| it.starts_with("data:image/png;base64,"));
    assert!(pictures.count() >= 2, "{links:?}");
    for text in [
        "&lt;script&gt;",
        "view coverage",
        "turn &lt;b&gt;once",
        "class=\"chart\"",
        "training</th><td>2</td>",
        "30.51",
    ] {
        shown(text);
    }
    for bad in [
        "<script",
        "<img src=x",
        " style=",
        "javascript:",
        "\u{202e}",
        "\u{1b}",
    ] {
        assert!(!body.contains(bad), "{bad}: {body}");
    }
    serving.abort();
}

#[tokio::test]
async fn an_unknown_model_has_no_report() {
    let stage = Stage::set().await;
    let (address, serving) = listen(&stage.service).await;
    let path = "/models/00000000-0000-4000-8000-000000000000/report.html";
    let (status, _, body) = ask(address, "GET", path).await;
    assert_eq!(status, 404);
    assert!(body.contains("does not exist"), "{body}");
    serving.abort();
}
