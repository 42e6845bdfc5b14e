//! The requests of a sign-in. They are open to everybody, and change nothing but by a key or by the issuer's word.

use super::issuer::IssuerError;
use super::page::{asked, failed, moved, own, shown};
use super::{BACK, BY_KEY, PAGE, START, grants, session};
use crate::access;
use crate::access::cookies::{self, Begun, is_encrypted};
use crate::config::OidcConfig;
use crate::context::Context;
use axum::Router;
use axum::body::{Body, to_bytes};
use axum::extract::{RawQuery, State};
use axum::http::header::HOST;
use axum::http::{HeaderMap, StatusCode, Uri};
use axum::response::Response;
use axum::routing::{get, post};
use std::sync::Arc;
use std::time::Duration;
use url::Position;
use yoto_dashboard::Fields;
use yoto_proto::sha256_hex;
use yoto_request::RequestError;

/// The field of a request that was made again at the service's address.
const HERE: &str = "here";
/// Maximum length of the form with a key, bytes.
const LONGEST: usize = 4 << 10;

/// The requests of a sign-in.
pub(crate) fn routes(context: Arc<Context>) -> Router {
    Router::new()
        .route(PAGE, get(page))
        .route(BY_KEY, post(by_key))
        .route(START, get(start))
        .route(BACK, get(back))
        .with_state(context)
}

async fn page(State(context): State<Arc<Context>>, RawQuery(query): RawQuery) -> Response {
    let fields = Fields::of_query(query);
    shown(context.config.oidc.as_ref(), fields.get("to"), "")
}

/// Somebody has written a key into the form.
async fn by_key(
    State(context): State<Arc<Context>>,
    uri: Uri,
    headers: HeaderMap,
    body: Body,
) -> Response {
    // Nobody is signed in as somebody else by a page of another site.
    if access::check_site(&uri, &headers).is_err() {
        let words = "another site's page has sent this form";
        return failed(StatusCode::FORBIDDEN, words);
    }
    let Ok(body) = to_bytes(body, LONGEST).await else {
        return failed(
            StatusCode::BAD_REQUEST,
            "the form is too long, or broke off",
        );
    };
    let fields = Fields::read(&body);
    let (key, to) = (fields.get("key").trim(), fields.get("to"));
    match is_valid(&context, key).await {
        Ok(()) => moved(
            own(to),
            [cookies::session(key, None, is_encrypted(&headers))],
        ),
        Err(RequestError::Refused { message, .. }) => {
            asked(context.config.oidc.as_ref(), to, &message)
        }
        Err(error) => unavailable(&error),
    }
}

async fn is_valid(context: &Context, key: &str) -> Result<(), RequestError> {
    let keys = context.callers.keys().await?;
    keys.find(&sha256_hex(key.as_bytes())).map(drop)
}

/// Sends somebody to the issuer, from the address to which the issuer sends them back: a browser keeps cookies by their host.
async fn start(
    State(context): State<Arc<Context>>,
    RawQuery(query): RawQuery,
    uri: Uri,
    headers: HeaderMap,
) -> Response {
    let Some(oidc) = &context.config.oidc else {
        return no_issuer();
    };
    let fields = Fields::of_query(query);
    // A proxy may name another host than the browser does, whatever the browser is told.
    let told = !fields.get(HERE).is_empty();
    if let (false, Some(place)) = (told, elsewhere(oidc, &uri, &headers, own(fields.get("to")))) {
        return moved(&place, []);
    }
    match context.issuer.issuer(oidc).await {
        Ok(issuer) => {
            let (url, begun) = issuer.begin(&oidc.request_scopes, own(fields.get("to")));
            moved(url.as_str(), [begun.cookie(is_https(oidc))])
        }
        Err(error) => not_asked(oidc, &error),
    }
}

/// The issuer has sent somebody back.
async fn back(
    State(context): State<Arc<Context>>,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
) -> Response {
    let Some(oidc) = &context.config.oidc else {
        return no_issuer();
    };
    let fields = Fields::of_query(query);
    let begun = Begun::of(&headers).filter(|it| it.state == fields.get("state"));
    let Some(begun) = begun else {
        let words = "this sign-in was started in another browser, or has timed out";
        return failed(StatusCode::BAD_REQUEST, words);
    };
    if fields.get("code").is_empty() {
        let words = format!("{} has not signed anybody in", oidc.host());
        tracing::info!(error = fields.get("error"), "{words}");
        return failed(StatusCode::FORBIDDEN, &words);
    }
    let claims = context.issuer.claims(oidc, fields.get("code"), &begun);
    let claims = match claims.await {
        Ok(claims) => claims,
        Err(error) => return not_asked(oidc, &error),
    };
    let Some(grant) = grants::of(oidc, &claims) else {
        let name = grants::name(&claims);
        tracing::info!("somebody whom no grant fits was not signed in");
        let words = format!(
            "{name} is known to {}, but has no access to this service: ask its operator",
            oidc.host()
        );
        return failed(StatusCode::FORBIDDEN, &words);
    };
    match session::begin(&context, oidc, &claims, grant).await {
        Ok(key) => {
            // The session that this browser had is not left open.
            if let Some(earlier) = cookies::session_of(&headers)
                && let Err(error) = session::end(&context, &earlier).await
            {
                tracing::warn!(%error, "an earlier session could not be ended");
            }
            let life = Duration::try_from_secs_f64(oidc.hours * 3600.0).ok();
            let session = cookies::session(&key, life, is_https(oidc));
            moved(own(&begun.to), Begun::over().into_iter().chain([session]))
        }
        Err(error) => unavailable(&error),
    }
}

/// The same request at the service's address; `None` if the browser is there.
fn elsewhere(oidc: &OidcConfig, uri: &Uri, headers: &HeaderMap, to: &str) -> Option<String> {
    // HTTP/2 names the host in the URI.
    let host = headers.get(HOST).and_then(|it| it.to_str().ok());
    let named = uri.authority().map(|it| it.as_str()).or(host)?;
    if named.eq_ignore_ascii_case(&oidc.address[Position::BeforeHost..Position::AfterPort]) {
        return None;
    }
    let mut place = oidc.address.join(START).ok()?;
    place
        .query_pairs_mut()
        .append_pair("to", to)
        .append_pair(HERE, "1");
    Some(place.into())
}

fn is_https(oidc: &OidcConfig) -> bool {
    oidc.address.scheme() == "https"
}

fn no_issuer() -> Response {
    let words = "this service has no issuer to sign in with: use a key";
    failed(StatusCode::NOT_FOUND, words)
}

fn not_asked(oidc: &OidcConfig, error: &IssuerError) -> Response {
    tracing::warn!(%error, issuer = oidc.issuer, "nobody was signed in");
    let words = format!(
        "{} has not signed anybody in; the service's log says why",
        oidc.host()
    );
    failed(StatusCode::BAD_GATEWAY, &words)
}

fn unavailable(error: &RequestError) -> Response {
    tracing::error!(%error, "nobody was signed in");
    failed(
        StatusCode::SERVICE_UNAVAILABLE,
        "nobody can be signed in now",
    )
}
