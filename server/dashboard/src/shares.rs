//! Links to the page that an export has made: on the page of its job.

use super::actions::{SentForm, form, see};
use super::asker::Asker;
use super::document::{self, Page};
use super::page_error::PageError;
use super::words::{ago, badge, page_of, seconds, short, told};
use axum::extract::Path;
use axum::http::header::ORIGIN;
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use maud::{Markup, PreEscaped, html};
use prost_types::Timestamp;
use qrcode::QrCode;
use qrcode::render::svg;
use tonic::Status;
use yoto_http::file_kind::page_of_export;
use yoto_proto::limits::OWNER_CHARACTERS;
use yoto_proto::progress::duration;
use yoto_proto::v1::share::State;
use yoto_proto::v1::{
    CreateShareRequest, Job, JobKind, ListSharesRequest, RevokeShareRequest, Share,
};

/// Most links of a job that are listed.
const LISTED: i32 = 100;
/// The choices of a link's end: days, and their words. 0: it does not end.
const ENDS: [(u32, &str); 5] = [
    (1, "in a day"),
    (7, "in a week"),
    (30, "in 30 days"),
    (365, "in a year"),
    (0, "never"),
];
/// The chosen one at first.
const FIRST: u32 = 30;
/// Seconds of a day.
const DAY: f64 = 86_400.0;

/// The links to the page of a job, and the form that makes one; nothing if the job has made no page.
///
/// # Errors
/// When the service can't tell.
pub(crate) async fn of_job(asker: &Asker, job: &Job) -> Result<Markup, Status> {
    if job.kind() != JobKind::Export || page_of_export(job).is_none() {
        return Ok(html! {});
    }
    let request = ListSharesRequest {
        page_size: LISTED,
        job: job.name.clone(),
        ..ListSharesRequest::default()
    };
    let shares = asker
        .services()
        .shares
        .list_shares(asker.request(request))
        .await?;
    let shares = shares.into_inner().shares;
    let new = form(
        asker,
        &format!("{}/share", page_of(&job.name)),
        &[],
        html! {
            label { "For whom " input name="note" maxlength=(OWNER_CHARACTERS); }
            label { "It ends "
                select name="days" {
                    @for (days, word) in ENDS { option value=(days) selected[days == FIRST] { (word) } }
                }
            }
            label { input type="checkbox" name="embed" value="yes"; " Other sites may show it" }
            button { "Make a link" }
        },
    )?;
    Ok(html! {
        h2 { "Links" }
        (listed(asker, &shares)?)
        details #share .act {
            summary { "Share…" }
            p { "Whoever has the link sees this page without a key, until the link ends." }
            (new)
        }
    })
}

fn listed(asker: &Asker, shares: &[Share]) -> Result<Markup, Status> {
    let now = asker.now();
    let mut rows = Vec::with_capacity(shares.len());
    for share in shares {
        let revoke = match share.state() {
            State::Valid | State::WithoutConsent => form(
                asker,
                &format!("/{}/revoke", share.name),
                &[],
                html! { button .bad { "Revoke" } },
            )?,
            _ => html! {},
        };
        rows.push(html! {
            tr {
                td { code { (short(&share.name)) } }
                td .text { bdi { (told(&share.note)) } }
                td { (ago(now, share.create_time.as_ref())) }
                td { (state(share, now)) }
                td { (revoke) }
            }
        });
    }
    Ok(html! {
        @if !rows.is_empty() {
            div .scroll tabindex="0" role="group" aria-label="Table" { table {
                thead { tr { th { "Link" } th { "For whom" } th { "Made" } th { "State" } th { "Action" } } }
                tbody { @for row in rows { (row) } }
            } }
        }
    })
}

fn state(share: &Share, now: f64) -> Markup {
    match share.state() {
        State::Revoked => badge("calm", "revoked"),
        State::Expired => badge("calm", "expired"),
        State::WithoutConsent => badge("bad", "without consent"),
        State::Unspecified | State::Valid => {
            let end = share.expire_time.as_ref().map(|it| seconds(it) - now);
            html! {
                (badge("good", "valid"))
                @if let Some(left) = end { " ends in " (duration(left)) }
            }
        }
    }
}

/// `POST /jobs/{id}/share`: the answer alone shows the link.
pub(crate) async fn create(
    asker: Asker,
    Path(id): Path<String>,
    headers: HeaderMap,
    SentForm(form): SentForm,
) -> Result<Page, PageError> {
    let days = form.get("days").parse::<u32>().ok();
    let days = days.filter(|days| ENDS.iter().any(|(it, _)| it == days));
    let days = days.ok_or_else(|| {
        PageError::of(
            StatusCode::BAD_REQUEST,
            "a link ends after one of the given times",
        )
    })?;
    let job = format!("jobs/{id}");
    let request = CreateShareRequest {
        job: job.clone(),
        note: form.get("note").to_owned(),
        embed: form.get("embed") == "yes",
        expire_time: (days > 0).then(|| Timestamp {
            seconds: (asker.now() + f64::from(days) * DAY) as i64,
            nanos: 0,
        }),
    };
    let made = asker
        .services()
        .shares
        .create_share(asker.request(request))
        .await?;
    let path = made.into_inner().path;
    // Browsers tell where the form is from, and so where the service is for others.
    let origin = headers.get(ORIGIN).and_then(|it| it.to_str().ok());
    let address = format!("{}{path}", origin.unwrap_or_default());
    Ok(document::still(
        "A link",
        html! {
            h1 { "A link" }
            p { "Copy it now: it is not shown again." }
            p .scroll { a #link href=(path) { code { (address) } } }
            (qr_code(&address))
            p { a href=(page_of(&job)) { "Back to the job" } }
        },
    ))
}

/// Side of a QR code, pixels.
const QR_SIDE: u32 = 220;

/// The address for the camera of a phone; nothing if it is too long for a QR code.
fn qr_code(address: &str) -> Markup {
    let drawn = QrCode::new(address.as_bytes()).map(|code| {
        let (dark, light) = (svg::Color("#000"), svg::Color("#fff"));
        let drawing = code
            .render()
            .dark_color(dark)
            .light_color(light)
            .min_dimensions(QR_SIDE, QR_SIDE)
            .build();
        // The declaration before it belongs to a file.
        let begin = drawing.find("<svg").unwrap_or_default();
        drawing[begin..].to_owned()
    });
    html! {
        @if let Ok(drawing) = drawn {
            figure #qr role="img" aria-label="The link as a QR code" { (PreEscaped(drawing)) }
        }
    }
}

/// `POST /shares/{id}/revoke`
pub(crate) async fn revoke(
    asker: Asker,
    Path(id): Path<String>,
    _: SentForm,
) -> Result<Response, PageError> {
    let request = RevokeShareRequest {
        name: format!("shares/{id}"),
    };
    let share = asker
        .services()
        .shares
        .revoke_share(asker.request(request))
        .await?;
    see(&page_of(&share.into_inner().job))
}
