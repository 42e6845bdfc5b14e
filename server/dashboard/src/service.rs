//! The service itself: version, health, queue, storage, usage and limits.

use super::asker::Asker;
use super::document::{self, Page};
use super::page_error::PageError;
use super::words::{ago, badge, bytes, kind_word, name, span, told, whole};
use super::{actions, usage};
use maud::{Markup, html};
use yoto_proto::v1::{GetLimitsRequest, GetUsageRequest, ServiceLimits, ServiceStatus};

/// `/service`
pub(crate) async fn page(asker: Asker) -> Result<Page, PageError> {
    let status = asker.status().await?;
    let limits = asker
        .services()
        .status
        .get_limits(asker.request(GetLimitsRequest {}));
    let limits = limits.await?.into_inner();
    let usage = asker
        .services()
        .tenants
        .get_usage(asker.request(GetUsageRequest::default()));
    let usage = usage.await?.into_inner();
    let signed_in = signed_in(&asker).await?;
    let faults = asker.backend().health_faults();
    let now = asker.now();
    let body = html! {
        h1 { "Service" }
        div #notices {
            @for fault in &faults { p .message .bad role="alert" { (fault) } }
            (notices(&status, now))
        }
        dl .facts {
            div { dt { "Health" } dd { @if faults.is_empty() { (badge("good", "ready")) } @else { (badge("bad", "not ready")) } } }
            div { dt { "Version" } dd { (told(&status.version)) } }
            div { dt { "Started" } dd { (ago(now, status.start_time.as_ref())) } }
            div { dt { "Running" } dd { (status.running) } }
            div { dt { "Queued" } dd { (status.queued) } }
            div { dt { "Active workers" } dd { (status.workers.len()) } }
        }
        div #signed-in { (signed_in) }
        h2 { "Storage" }
        (storage(&asker, &status, &limits, now))
        (usage::table(&usage))
        h2 { "Limits" }
        (limits_table(&limits))
    };
    Ok(document::live("Service", "/service", "", body))
}

/// Who looks, and the button by which they sign out. Empty where no key is asked for.
async fn signed_in(asker: &Asker) -> Result<Markup, PageError> {
    let Some(id) = asker.key() else {
        return Ok(html! {});
    };
    let key = asker.backend().key(&id).await?;
    let now = asker.now();
    let end = key.expire_time.as_ref().map(|it| it.seconds as f64 - now);
    let leave = actions::form(asker, "/sign-out", &[], html! { button { "Sign out" } })?;
    Ok(html! {
        h2 { "You" }
        dl .facts {
            div { dt { "Key" } dd { (told(&key.display_name)) } }
            div { dt { "Tenant" } dd { (told(&key.tenant)) } }
            div { dt { "Ends" } dd { @match end { Some(left) => { "in " (span(left)) }, None => "never by itself" } } }
        }
        (leave)
    })
}

/// What keeps jobs from being taken.
///
/// `now` is in seconds since 1970.
pub(crate) fn notices(status: &ServiceStatus, now: f64) -> Markup {
    html! {
        @if let Some(draining) = &status.draining {
            p .message .warn {
                "The service takes no new jobs"
                @if !draining.reason.is_empty() { ": " (name(&draining.reason)) }
                ", since " (ago(now, draining.since.as_ref()))
                @if !draining.by.is_empty() { ", by " (name(&draining.by)) }
            }
        }
        @for paused in &status.paused {
            p .message .warn {
                "Jobs of the kind " (kind_word(paused.kind())) " are paused"
                @if !paused.reason.is_empty() { ": " (name(&paused.reason)) }
                ", since " (ago(now, paused.since.as_ref()))
                @if !paused.by.is_empty() { ", by " (name(&paused.by)) }
            }
        }
    }
}

fn storage(asker: &Asker, status: &ServiceStatus, limits: &ServiceLimits, now: f64) -> Markup {
    let room = limits.upload.as_ref().and_then(|it| it.room_bytes);
    let collected = asker.backend().last_collected();
    let grace = asker.backend().grace().as_secs_f64();
    html! {
        @if let (Some(free), Some(total)) = (status.disk_free, status.disk_total) {
            @let used = total.saturating_sub(free);
            @let percent = 100 * u128::from(used) / u128::from(total.max(1));
            div .progress {
                meter min="0" max="100" high="90" value=(percent) aria-label="share of the disk in use" { (percent) " %" }
                p .detail { (bytes(free)) " of " (bytes(total)) " free" }
            }
        }
        dl .facts {
            div { dt { "Objects" } dd { (told(&status.objects)) } }
            @if let Some(room) = room { div { dt { "Room for uploads" } dd { (bytes(room)) } } }
            div { dt { "Last collection" } dd {
                @match collected {
                    Some(at) => { (span(now - at)) " ago, by this coordinator" },
                    None => "not since this coordinator started",
                }
            } }
            div { dt { "Time of grace" } dd { (span(grace)) } }
        }
    }
}

fn limits_table(limits: &ServiceLimits) -> Markup {
    let upload = limits.upload.unwrap_or_default();
    let rows = [
        ("A file of a capture", bytes(upload.file_bytes)),
        ("A capture", bytes(upload.capture_bytes)),
        ("Files of a capture", whole(upload.files)),
        ("An upload without a write", span(upload.expiry_seconds)),
        ("A message", bytes(limits.message_bytes)),
        ("An order", bytes(limits.order_bytes)),
        ("Pictures of a render", whole(limits.render_pictures.into())),
    ];
    html! {
        div .scroll tabindex="0" role="group" aria-label="Table" { table {
            tbody { @for (what, most) in rows { tr { th scope="row" { (what) } td { (most) } } } }
        } }
    }
}
