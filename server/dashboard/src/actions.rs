//! Forms that change something, and what becomes of them.

use super::asker::Asker;
use super::fault::Fault;
use super::query::Fields;
use super::token;
use super::words::page_of;
use axum::body::Body;
use axum::extract::Path;
use axum::http::header::LOCATION;
use axum::http::{HeaderMap, HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use maud::{Markup, html};
use tonic::Status;
use yoto_proto::v1::{
    CancelJobRequest, CordonWorkerRequest, RetryJobRequest, UncordonWorkerRequest,
};

/// The field with the id of the request that a form makes.
const REQUEST: &str = "request";

/// A form that is sent to `path` with hidden `fields`; `inside` has what a person sees of it.
///
/// # Errors
/// When no layer has told who asks.
pub(crate) fn form(
    asker: &Asker,
    path: &str,
    fields: &[(&str, &str)],
    inside: Markup,
) -> Result<Markup, Status> {
    let own = [
        (token::FIELD, asker.token()?),
        (REQUEST, Asker::request_id()),
    ];
    Ok(html! {
        form method="post" action=(path) {
            @for (name, value) in &own { input type="hidden" name=(name) value=(value); }
            @for (name, value) in fields { input type="hidden" name=(name) value=(value); }
            (inside)
        }
    })
}

/// The fields of a form of one of our own pages.
///
/// # Errors
/// As [`token::checked`].
pub(crate) async fn sent(asker: &Asker, headers: &HeaderMap, body: Body) -> Result<Fields, Fault> {
    token::checked(&asker.token()?, headers, body).await
}

/// `/sign-out`: ends the session.
pub(crate) async fn sign_out(
    asker: Asker,
    headers: HeaderMap,
    body: Body,
) -> Result<Response, Fault> {
    sent(&asker, &headers, body).await?;
    if let Some(key) = asker.key() {
        asker.backend().sign_out(&key).await?;
    }
    Ok(asker.backend().signed_out())
}

/// The id of the request that a form makes.
pub(crate) fn request_of(form: &Fields) -> String {
    form.get(REQUEST).to_owned()
}

/// The page at `path`, which a browser asks for now. A reload of it does not send the form again.
///
/// # Errors
/// Never in practice: when the path can't be an address.
pub(crate) fn see(path: &str) -> Result<Response, Fault> {
    let failed = |_| Fault::of(StatusCode::INTERNAL_SERVER_ERROR, "the page has no address");
    let location = HeaderValue::try_from(path).map_err(failed)?;
    Ok((StatusCode::SEE_OTHER, [(LOCATION, location)]).into_response())
}

/// `POST /jobs/{id}/cancel`
pub(crate) async fn cancel(
    asker: Asker,
    Path(id): Path<String>,
    headers: HeaderMap,
    body: Body,
) -> Result<Response, Fault> {
    let form = sent(&asker, &headers, body).await?;
    let request = CancelJobRequest {
        name: format!("jobs/{id}"),
        request_id: request_of(&form),
    };
    let job = asker
        .services()
        .jobs
        .cancel_job(asker.request(request))
        .await?;
    see(&page_of(&job.into_inner().name))
}

/// `POST /jobs/{id}/retry`
pub(crate) async fn retry(
    asker: Asker,
    Path(id): Path<String>,
    headers: HeaderMap,
    body: Body,
) -> Result<Response, Fault> {
    let form = sent(&asker, &headers, body).await?;
    let request = RetryJobRequest {
        name: format!("jobs/{id}"),
        request_id: request_of(&form),
    };
    let job = asker
        .services()
        .jobs
        .retry_job(asker.request(request))
        .await?;
    see(&page_of(&job.into_inner().name))
}

/// `POST /workers/cordon`
pub(crate) async fn cordon(
    asker: Asker,
    headers: HeaderMap,
    body: Body,
) -> Result<Response, Fault> {
    let form = sent(&asker, &headers, body).await?;
    let request = CordonWorkerRequest {
        display_name: form.get("worker").to_owned(),
        reason: form.get("reason").to_owned(),
    };
    asker
        .services()
        .status
        .cordon_worker(asker.request(request))
        .await?;
    see("/workers")
}

/// `POST /workers/uncordon`
pub(crate) async fn uncordon(
    asker: Asker,
    headers: HeaderMap,
    body: Body,
) -> Result<Response, Fault> {
    let form = sent(&asker, &headers, body).await?;
    let request = UncordonWorkerRequest {
        display_name: form.get("worker").to_owned(),
    };
    asker
        .services()
        .status
        .uncordon_worker(asker.request(request))
        .await?;
    see("/workers")
}
