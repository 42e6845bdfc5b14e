//! The page behind a link, for everybody who has the link.
//!
//! Links that never were, have ended, or lack the person's consent get the same answer. A page may do no more than play: its
//! origin is its own, and it can load nothing.

use crate::access::keys::FRESH;
use crate::context::Context;
use axum::BoxError;
use axum::body::Body;
use axum::extract::{Path, State};
use axum::http::header::{
    ACCESS_CONTROL_ALLOW_ORIGIN, CACHE_CONTROL, CONTENT_LENGTH, CONTENT_SECURITY_POLICY,
    CONTENT_TYPE, REFERRER_POLICY, X_CONTENT_TYPE_OPTIONS,
};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use futures::{Stream, StreamExt, TryStreamExt};
use std::sync::Arc;
use std::time::Instant;
use yoto_http::file_kind::{EMBEDDED_PLAYER, LONE_PLAYER, page_of_export};
use yoto_proto::sha256_hex;
use yoto_request::RequestError;
use yoto_store::StoreError;

/// `/share/{secret}`
pub(super) async fn page(
    State(context): State<Arc<Context>>,
    Path(secret): Path<String>,
) -> Response {
    match found(&context, &secret).await {
        Ok(Some(page)) => page,
        Ok(None) => {
            let words = "this link shows nothing: it has ended, or was never one\n";
            (StatusCode::NOT_FOUND, words).into_response()
        }
        Err(error) => {
            tracing::error!(%error, "the page of a link can't be shown");
            let words = "the page can't be shown now\n";
            (StatusCode::SERVICE_UNAVAILABLE, words).into_response()
        }
    }
}

async fn found(context: &Context, secret: &str) -> Result<Option<Response>, RequestError> {
    let store = &context.store;
    let Some(shared) = store.shared(&sha256_hex(secret.as_bytes())).await? else {
        return Ok(None);
    };
    let job = match store.job(&shared.tenant, &shared.job_id).await {
        // It was deleted since then.
        Err(StoreError::NotFound { .. }) => return Ok(None),
        job => job?,
    };
    let Some(object) = page_of_export(&job) else {
        return Ok(None);
    };
    let bytes = context.objects.stream(object, None).await?;
    let mut headers = HeaderMap::new();
    let policy = match shared.embed {
        true => EMBEDDED_PLAYER,
        false => LONE_PLAYER,
    };
    let own = [
        (CONTENT_SECURITY_POLICY, policy),
        (CONTENT_TYPE, "text/html; charset=utf-8"),
        // A revocation counts at the next visit.
        (CACHE_CONTROL, "no-store"),
        (X_CONTENT_TYPE_OPTIONS, "nosniff"),
        // The address is the secret.
        (REFERRER_POLICY, "no-referrer"),
        (HeaderName::from_static("x-robots-tag"), "noindex, nofollow"),
    ];
    for (name, value) in own {
        headers.insert(name, HeaderValue::from_static(value));
    }
    if shared.embed {
        // The element `<yoto-avatar>` of another site asks for the page.
        headers.insert(ACCESS_CONTROL_ALLOW_ORIGIN, HeaderValue::from_static("*"));
    }
    headers.insert(CONTENT_LENGTH, HeaderValue::from(object.bytes));
    let bytes = while_shown(bytes, context, secret);
    Ok(Some((headers, Body::from_stream(bytes)).into_response()))
}

/// The bytes of the page, as long as its link shows it: one that is revoked ends, also for somebody who reads slowly.
fn while_shown<S, E>(
    bytes: S,
    context: &Context,
    secret: &str,
) -> impl Stream<Item = Result<Bytes, BoxError>> + use<S, E>
where
    S: Stream<Item = Result<Bytes, E>>,
    E: std::error::Error + Send + Sync + 'static,
{
    let (store, sha256) = (Arc::clone(&context.store), sha256_hex(secret.as_bytes()));
    let looked = Instant::now();
    bytes
        .map_err(BoxError::from)
        .scan(looked, move |looked, chunk| {
            let due = looked.elapsed() > FRESH;
            if due {
                *looked = Instant::now();
            }
            let (store, sha256) = (Arc::clone(&store), sha256.clone());
            async move {
                if due && store.shared(&sha256).await.ok().flatten().is_none() {
                    return Some(Err("the link has ended".into()));
                }
                Some(chunk)
            }
        })
}
