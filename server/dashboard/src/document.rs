//! The document around what a page shows.

use super::assets::{BUILD, ICON, SCRIPT, STYLE};
use super::headers::secure;
use axum::response::{IntoResponse, Response};
use maud::{DOCTYPE, Markup, html};

/// A page as an answer.
#[derive(Debug)]
pub(crate) struct Page(pub String);

impl IntoResponse for Page {
    fn into_response(self) -> Response {
        axum::response::Html(self.0).into_response()
    }
}

/// The parts of the navigation: title and path.
const PARTS: [(&str, &str); 6] = [
    ("Overview", "/"),
    ("People", "/people"),
    ("Models", "/models"),
    ("Jobs", "/jobs"),
    ("Workers", "/workers"),
    ("Service", "/service"),
];

/// A page that is shown again after each of `events`, the query of their stream. `part` is the path of its part of the navigation.
///
/// The script compares elements at the same place. So a part of `body` that comes and goes stands in an element that stays.
pub(crate) fn live(title: &str, part: &str, events: &str, body: Markup) -> Page {
    document(title, Some(part), Some(events), body)
}

/// A page that stays as it is.
pub(crate) fn still(title: &str, body: Markup) -> Page {
    document(title, Some(""), None, body)
}

/// A page for somebody who may see no other one.
pub fn outside(title: &str, body: Markup) -> Response {
    secure(document(title, None, None, body).into_response())
}

/// `part` is the path of the part of the navigation; none without a navigation.
fn document(title: &str, part: Option<&str>, events: Option<&str>, body: Markup) -> Page {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                meta name="yoto-build" content=(*BUILD);
                @if let Some(events) = events {
                    meta name="yoto-events" content={ "/events?" (events) };
                }
                title { (title) " · yoto" }
                link rel="icon" type="image/svg+xml" href=(ICON.path);
                link rel="stylesheet" href=(STYLE.path);
                script src=(SCRIPT.path) defer {}
            }
            body {
                a .skip href="#main" { "Skip to the content" }
                header {
                    a .brand href="/" { "yoto" }
                    @if let Some(part) = part { nav aria-label="Parts" {
                        @for (name, path) in PARTS {
                            @let current = (path == part).then_some("page");
                            a href=(path) aria-current=[current] { (name) }
                        }
                    } }
                    span #live hidden {}
                }
                p #notice role="status" hidden {}
                main #main tabindex="-1" { (body) }
            }
        }
    };
    Page(page.into_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_names_its_place_and_loads_only_its_own_files() {
        let Page(page) = live("A <b>", "/jobs", "job=1", html! { "x" });
        assert!(page.contains("<title>A &lt;b&gt; · yoto</title>"), "{page}");
        assert!(page.contains(r#"<a href="/jobs" aria-current="page">Jobs</a>"#));
        assert!(page.contains(r#"content="/events?job=1""#));
        assert!(!page.contains("style=") && !page.contains("://"), "{page}");
        let Page(still) = still("x", html! {});
        assert!(!still.contains("yoto-events") && !still.contains("aria-current"));
    }
}
