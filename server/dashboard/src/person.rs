//! One person: captures with what the check has found, and the models that have them.

use super::asker::Asker;
use super::document::{self, Page};
use super::page_error::PageError;
use super::people::portrait;
use super::upload::{self, Whose};
use super::words::{
    ago, badge, bytes, capture_state, count, name, page_of, short, subject_state, told,
};
use super::{avatar, findings};
use axum::extract::Path;
use maud::{Markup, html};
use tonic::Status;
use yoto_proto::text::visible;
use yoto_proto::v1::consent_item::State;
use yoto_proto::v1::{Consent, ConsentPurpose, capture, subject};
use yoto_store::CaptureFiles;

/// `/people/{id}`
pub(crate) async fn page(asker: Asker, Path(id): Path<String>) -> Result<Page, PageError> {
    let resource = format!("subjects/{id}");
    let subject = asker.subject(&resource).await?;
    let (backend, tenant) = (asker.backend(), asker.tenant()?);
    let captures = backend.captures(&tenant, &resource).await?;
    let models = backend.memberships(&tenant, &resource).await?;
    let (models, others): (Vec<_>, Vec<_>) =
        models.into_iter().partition(|it| it.trained.is_some());
    let consents = backend.consents(&tenant, &[&resource]).await?;
    let now = asker.now();
    let mut shown = Vec::new();
    for capture in captures.iter().rev() {
        shown.push(section(&asker, now, &subject.display_name, capture).await?);
    }
    let title = told(&subject.display_name);
    let avatar = match subject.state() {
        subject::State::Ready => Some(avatar::form_of(&asker, &subject, &others)?),
        _ => None,
    };
    let takes_more = match subject.state() {
        subject::State::Ready | subject::State::Rejected => true,
        // The upload of a further capture goes on; that of the first one does on the page of all people.
        subject::State::Uploading => captures.len() > 1,
        _ => false,
    };
    let more = match takes_more {
        true => {
            let limits = upload::limits(&asker).await?;
            Some(upload::form(&asker, Whose::Known(&subject), &limits)?)
        }
        false => None,
    };
    let body = html! {
        h1 { (name(&subject.display_name)) " " (subject_state(subject.state())) }
        dl .facts {
            div { dt { "Added" } dd { (ago(now, subject.create_time.as_ref())) } }
            div { dt { "Captures" } dd { (captures.len()) } }
            div { dt { "Models" } dd {
                @if models.is_empty() { "none" }
                @for (at, it) in models.iter().enumerate() {
                    @if at > 0 { ", " }
                    a href=(page_of(&it.model)) { (name(&it.display_name)) }
                    @if it.trained == Some(false) { " " (badge("calm", "not trained")) }
                }
            } }
            div { dt { "Id" } dd { code { (id) } } }
        }
        // Always here, so that an update of the page finds the form where it was, with what it sends.
        div #orders { @if let Some(avatar) = avatar { (avatar) } }
        div #more { @if let Some(more) = more { (more) } }
        @if !subject.consent_note.is_empty() || !consents.is_empty() {
            h2 { "Consent" }
            @if !subject.consent_note.is_empty() { p .note { (visible(&subject.consent_note)) } }
            @for consent in &consents { p .detail { (agreed(now, consent)) } }
        }
        h2 { "Captures" }
        @if shown.is_empty() { p .empty { "None." } }
        @for section in shown { (section) }
    };
    Ok(document::live(&title, "/people", "", body))
}

/// A record of what the person agrees to.
pub(crate) fn agreed(now: f64, consent: &Consent) -> Markup {
    html! {
        "to "
        @for (place, item) in consent.items.iter().enumerate() {
            @if place > 0 { ", " }
            (purpose(item.purpose()))
            @match item.state() {
                State::Valid | State::Unspecified => {},
                State::Expired => { " " (badge("bad", "run out")) },
                State::Revoked => { " " (badge("bad", "revoked")) },
            }
        }
        ", noted " (ago(now, consent.create_time.as_ref()))
        @if let Some(end) = &consent.expire_time { ", until " (end.to_string()) }
        @if !consent.given_by.is_empty() { ", given by " (visible(&consent.given_by)) }
        @if let Some(evidence) = &consent.evidence { ", proved by " (visible(&evidence.file_name)) }
        @if !consent.note.is_empty() { ": " (visible(&consent.note)) }
    }
}

/// The purpose as commands spell it.
fn purpose(purpose: ConsentPurpose) -> String {
    let name = purpose.as_str_name().trim_start_matches("CONSENT_");
    name.to_ascii_lowercase()
}

/// A capture.
async fn section(
    asker: &Asker,
    now: f64,
    person: &str,
    capture: &CaptureFiles,
) -> Result<Markup, Status> {
    let report = findings::read(asker, capture).await?;
    let capture = &capture.capture;
    Ok(html! {
        section .panel {
            div .row {
                (portrait(person, Some(capture)))
                div {
                    h3 {
                        "Capture " (short(&capture.name)) " " (capture_state(capture.state()))
                        @if let Some(report) = &report { " check: " (report.grade()) }
                    }
                    p .detail {
                        @if capture.frames > 0 {
                            (count(capture.frames.into(), "frame")) " of " (capture.width) " × " (capture.height) ", "
                        }
                        @if capture.shard_bytes > 0 { (bytes(capture.shard_bytes)) ", " }
                        (ago(now, capture.create_time.as_ref()))
                    }
                    @if !capture.ingest_job.is_empty() {
                        p { a href=(page_of(&capture.ingest_job)) { "Ingest job" } }
                    }
                }
            }
            (findings::violations(&capture.violations))
            @if let Some(report) = &report { (report.table()) }
            @else if capture.state() == capture::State::Ready {
                p .detail { "The service has no report of its check: an earlier version has read it." }
            }
        }
    })
}
