//! The issuer of OpenID Connect: where people are sent, and who they are when they come back.
//!
//! The authorization code flow with PKCE (RFC 7636).

use super::BACK;
use super::fetch::{self, FetchError};
use super::grants::Claims;
use crate::access::cookies::Begun;
use crate::config::OidcConfig;
use base64::Engine;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use openidconnect::core::{CoreAuthenticationFlow, CoreClient, CoreIdToken, CoreProviderMetadata};
use openidconnect::{
    AuthorizationCode, ClientId, ClientSecret, CsrfToken, EndpointMaybeSet, EndpointNotSet,
    EndpointSet, HttpRequest, IssuerUrl, Nonce, PkceCodeChallenge, PkceCodeVerifier, RedirectUrl,
    Scope,
};
use std::path::PathBuf;
use std::time::{Duration, UNIX_EPOCH};
use thiserror::Error;
use url::Url;
use yoto_process::clock::{Clock, SystemClock};

/// A client of an issuer whose description was read.
type Client = CoreClient<
    EndpointSet,
    EndpointNotSet,
    EndpointNotSet,
    EndpointNotSet,
    EndpointMaybeSet,
    EndpointMaybeSet,
>;

/// How far the issuer's clock may be behind the coordinator's: its tokens may last no longer than a minute.
const SKEW: Duration = Duration::from_secs(60);

/// Why nobody can sign in by the issuer.
#[derive(Debug, Error)]
pub(crate) enum IssuerError {
    /// The file of the secret can't be read.
    #[error("{}: {cause}", path.display())]
    Secret {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: std::io::Error,
    },
    /// No request can be made.
    #[error(transparent)]
    Fetch(#[from] FetchError),
    /// The issuer's description can't be read.
    #[error("the issuer's description can't be read: {0}")]
    Discovery(String),
    /// The settings have a malformed URL.
    #[error(transparent)]
    Url(#[from] url::ParseError),
    /// The issuer has refused to exchange the code for a token.
    #[error("the issuer has given no token for the code: {0}")]
    Exchange(String),
    /// The issuer says nothing about the person.
    #[error("the issuer has sent no ID token")]
    NoToken,
    /// The token is not one of the issuer for this service and this sign-in.
    #[error("the ID token does not count: {0}")]
    Token(String),
}

/// An issuer whose description was read.
#[derive(Debug)]
pub(crate) struct Issuer {
    client: Client,
    http: reqwest::Client,
}

impl Issuer {
    /// Reads the issuer's description and keys.
    ///
    /// # Errors
    /// When the issuer can't be reached, or is another one.
    pub(crate) async fn find(config: &OidcConfig) -> Result<Self, IssuerError> {
        let secret = match &config.client_secret_file {
            None => None,
            Some(path) => {
                let read = tokio::fs::read_to_string(path).await;
                let text = read.map_err(|cause| IssuerError::Secret {
                    path: path.clone(),
                    cause,
                })?;
                Some(ClientSecret::new(text.trim().to_owned()))
            }
        };
        let http = fetch::client()?;
        let url = IssuerUrl::new(config.issuer.clone())?;
        let asked = http.clone();
        let get = move |request: HttpRequest| fetch::fetch(asked.clone(), request);
        let description = CoreProviderMetadata::discover_async(url, &get).await;
        let description = description.map_err(|error| IssuerError::Discovery(causes(&error)))?;
        let id = ClientId::new(config.client_id.clone());
        let back = RedirectUrl::from_url(config.address.join(BACK)?);
        let client = CoreClient::from_provider_metadata(description, id, secret);
        Ok(Self {
            client: client.set_redirect_uri(back),
            http,
        })
    }

    /// Where somebody who wants to see the page `to` is sent, and what is known of them when they come back.
    pub(crate) fn begin(&self, scopes: &[String], to: &str) -> (Url, Begun) {
        let (challenge, verifier) = PkceCodeChallenge::new_random_sha256();
        let request = self.client.authorize_url(
            CoreAuthenticationFlow::AuthorizationCode,
            CsrfToken::new_random,
            Nonce::new_random,
        );
        let scopes = scopes.iter().map(|it| Scope::new(it.clone()));
        let (url, state, nonce) = request
            .add_scopes(scopes)
            .set_pkce_challenge(challenge)
            .url();
        let begun = Begun {
            state: state.secret().clone(),
            nonce: nonce.secret().clone(),
            verifier: verifier.secret().clone(),
            to: to.to_owned(),
        };
        (url, begun)
    }

    /// The ID token of somebody who has come back with `code`, which can't be used again.
    ///
    /// # Errors
    /// When the issuer gives none.
    pub(crate) async fn token(
        &self,
        code: &str,
        begun: &Begun,
    ) -> Result<CoreIdToken, IssuerError> {
        let failed = |error: &dyn std::error::Error| IssuerError::Exchange(causes(error));
        let http = self.http.clone();
        let get = move |request: HttpRequest| fetch::fetch(http.clone(), request);
        let exchange = self
            .client
            .exchange_code(AuthorizationCode::new(code.to_owned()))
            .map_err(|error| failed(&error))?;
        let answer = exchange
            .set_pkce_verifier(PkceCodeVerifier::new(begun.verifier.clone()))
            .request_async(&get)
            .await
            .map_err(|error| failed(&error))?;
        let token = answer.extra_fields().id_token().cloned();
        token.ok_or(IssuerError::NoToken)
    }

    /// The claims of a token.
    ///
    /// # Errors
    /// When it is not signed by a key of the issuer that is known here, or not for this service and this sign-in, or over.
    pub(crate) fn claims(&self, token: &CoreIdToken, begun: &Begun) -> Result<Claims, IssuerError> {
        let nonce = Nonce::new(begun.nonce.clone());
        let verifier = self.client.id_token_verifier();
        let verifier = verifier.set_time_fn(|| {
            let now = UNIX_EPOCH + Duration::from_secs_f64(SystemClock.now());
            (now - SKEW).into()
        });
        let checked = token.claims(&verifier, &nonce);
        checked.map_err(|error| IssuerError::Token(causes(&error)))?;
        all_claims(&token.to_string())
    }
}

/// All claims of a token that was checked: the library's type has those of the standard alone.
fn all_claims(token: &str) -> Result<Claims, IssuerError> {
    let malformed = || IssuerError::Token("its claims can't be read".to_owned());
    let payload = token.split('.').nth(1).ok_or_else(malformed)?;
    let json = URL_SAFE_NO_PAD.decode(payload).map_err(|_| malformed())?;
    serde_json::from_slice(&json).map_err(|_| malformed())
}

/// An error with what has caused it, in one line.
fn causes(error: &dyn std::error::Error) -> String {
    let all = std::iter::successors(Some(error), |it| it.source());
    let words: Vec<String> = all.map(ToString::to_string).collect();
    words.join(": ")
}
