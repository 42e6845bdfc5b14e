//! Forms that change something, and what becomes of them.

use super::asker::{Asker, Site};
use super::page_error::PageError;
use super::query::Fields;
use super::token;
use super::words::page_of;
use axum::extract::{FromRequest, FromRequestParts, Path, Request};
use axum::http::header::LOCATION;
use axum::http::{HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use maud::{Markup, html};
use std::sync::Arc;
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

/// The fields of a form that one of our own pages has sent. Any other request is refused, as [`token::checked`] says.
pub(crate) struct SentForm(pub Fields);

impl FromRequest<Arc<Site>> for SentForm {
    type Rejection = PageError;

    async fn from_request(request: Request, site: &Arc<Site>) -> Result<Self, PageError> {
        let (mut parts, body) = request.into_parts();
        let Ok(asker) = Asker::from_request_parts(&mut parts, site).await;
        let fields = token::checked(&asker.token()?, &parts.headers, body).await?;
        Ok(Self(fields))
    }
}

/// `/sign-out`: ends the session.
pub(crate) async fn sign_out(asker: Asker, _: SentForm) -> Result<Response, PageError> {
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
pub(crate) fn see(path: &str) -> Result<Response, PageError> {
    let failed = |_| PageError::of(StatusCode::INTERNAL_SERVER_ERROR, "the page has no address");
    let location = HeaderValue::try_from(path).map_err(failed)?;
    Ok((StatusCode::SEE_OTHER, [(LOCATION, location)]).into_response())
}

/// `POST /jobs/{id}/cancel`
pub(crate) async fn cancel(
    asker: Asker,
    Path(id): Path<String>,
    SentForm(form): SentForm,
) -> Result<Response, PageError> {
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
    SentForm(form): SentForm,
) -> Result<Response, PageError> {
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
pub(crate) async fn cordon(asker: Asker, SentForm(form): SentForm) -> Result<Response, PageError> {
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
    SentForm(form): SentForm,
) -> Result<Response, PageError> {
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
