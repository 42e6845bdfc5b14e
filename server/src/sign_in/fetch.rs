//! Requests to the issuer.

use crate::outgoing;
use openidconnect::{HttpRequest, HttpResponse};
use reqwest::redirect::Policy;
use std::time::Duration;

/// Time limit of a request.
const PATIENCE: Duration = Duration::from_secs(10);
/// Maximum length of an answer, bytes.
const LONGEST: usize = 1 << 20;

/// Why the issuer could not be asked.
#[derive(Debug, thiserror::Error)]
pub(crate) enum FetchError {
    /// The request failed.
    #[error(transparent)]
    Request(#[from] reqwest::Error),
    /// The machine has no usable TLS.
    #[error(transparent)]
    Tls(#[from] rustls::Error),
    /// The answer can't be one.
    #[error("the answer has more than {LONGEST} bytes")]
    Long,
    /// The answer has headers that HTTP does not know.
    #[error(transparent)]
    Http(#[from] axum::http::Error),
}

/// A client that follows no redirection: an address that the issuer's description names is asked, and no other.
///
/// # Errors
/// When the machine has no usable TLS.
pub(super) fn client() -> Result<reqwest::Client, FetchError> {
    let builder = reqwest::Client::builder()
        .tls_backend_preconfigured(outgoing::tls()?)
        .redirect(Policy::none())
        .timeout(PATIENCE);
    Ok(builder.build()?)
}

/// The answer to `request`.
///
/// # Errors
/// When the request fails or times out, or the answer is too long.
pub(super) async fn fetch(
    client: reqwest::Client,
    request: HttpRequest,
) -> Result<HttpResponse, FetchError> {
    let request = reqwest::Request::try_from(request)?;
    let mut answer = client.execute(request).await?;
    let mut built = axum::http::Response::builder().status(answer.status());
    if let Some(headers) = built.headers_mut() {
        headers.clone_from(answer.headers());
    }
    let mut body = Vec::new();
    while let Some(chunk) = answer.chunk().await? {
        if body.len() + chunk.len() > LONGEST {
            return Err(FetchError::Long);
        }
        body.extend_from_slice(&chunk);
    }
    Ok(built.body(body)?)
}
