//! The people of the service.

use super::asker::Asker;
use super::document::{self, Page};
use super::page_error::PageError;
use super::query::Fields;
use super::upload::{self, Whose};
use super::words::{count, name, page_of, subject_state};
use axum::extract::RawQuery;
use maud::{Markup, html};
use yoto_proto::v1::{Capture, ListSubjectsRequest, Subject};
use yoto_store::Person;

/// People per page.
const PER_PAGE: i32 = 60;

/// `/people`
pub(crate) async fn page(asker: Asker, RawQuery(query): RawQuery) -> Result<Page, PageError> {
    let query = Fields::of_query(query);
    let request = ListSubjectsRequest {
        page_size: PER_PAGE,
        page_token: query.get("page").to_owned(),
    };
    let list = asker
        .services()
        .subjects
        .list_subjects(asker.request(request));
    let list = list.await?.into_inner();
    let names: Vec<&str> = list.subjects.iter().map(|it| &*it.name).collect();
    let people = asker.backend().people(&asker.tenant()?, &names).await?;
    let limits = upload::limits(&asker).await?;
    let open = list.subjects.is_empty();
    let body = html! {
        h1 { "People" }
        (upload::form(&asker, Whose::New { open }, &limits)?)
        @if list.subjects.is_empty() {
            p .empty {
                "Nobody yet. " code { "yoto subject add NAME CAPTURE" }
                " uploads the first capture, and " code { "yoto avatar clip.mp4" } " makes a person from a film."
            }
        }
        ul .cards {
            @for subject in &list.subjects {
                li { (card(subject, people.get(&subject.name).and_then(portrayed))) }
            }
        }
        (more("/people", &list.next_page_token))
    };
    Ok(document::live("People", "/people", "", body))
}

/// The link to the next page of a list.
pub(crate) fn more(path: &str, token: &str) -> Markup {
    html! {
        @if !token.is_empty() {
            // A token is hex.
            p { a .more rel="next" href={ (path) (if path.contains('?') { "&" } else { "?" }) "page=" (token) } { "More" } }
        }
    }
}

/// The capture by which pages show a person: the newest one that is ready, or else the newest.
pub(crate) fn portrayed(person: &Person) -> Option<&Capture> {
    person.portrait.as_ref().map(|it| &it.capture)
}

/// A person with a picture.
pub(crate) fn card(subject: &Subject, capture: Option<&Capture>) -> Markup {
    let frames = capture.map_or(0, |it| it.frames);
    html! {
        a .card href=(page_of(&subject.name)) {
            (portrait(&subject.display_name, capture))
            span .title { (name(&subject.display_name)) }
            (subject_state(subject.state()))
            span .detail {
                (count(subject.captures.len() as u64, "capture"))
                @if frames > 0 { ", " (count(frames.into(), "frame")) }
            }
        }
    }
}

/// The thumbnail of a capture, or a place for it.
pub(crate) fn portrait(name: &str, capture: Option<&Capture>) -> Markup {
    let shown = capture.filter(|it| !it.thumbnail.is_empty());
    html! {
        @match shown {
            // Its ingest job makes it: another one has another address.
            Some(capture) => img .portrait loading="lazy" width="96" height="96" alt={ "Picture of " (super::words::told(name)) }
                src={ "/" (capture.name) "/thumbnail.png?of=" (super::words::short(&capture.ingest_job)) };,
            None => span .portrait .none aria-hidden="true" { "?" },
        }
    }
}
