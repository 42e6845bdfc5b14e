//! An issuer of OpenID Connect on a port of this machine: it knows whom a test expects, and signs with a key of its own.

use crate::support::ask_with;
use axum::Router;
use axum::extract::{RawQuery, State};
use axum::http::StatusCode;
use axum::http::header::CONTENT_TYPE;
use axum::response::{IntoResponse, Redirect, Response};
use axum::routing::{get, post};
use base64::Engine;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use ring::rand::SystemRandom;
use ring::signature::{ECDSA_P256_SHA256_FIXED_SIGNING, EcdsaKeyPair, KeyPair};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use std::collections::HashMap;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, PoisonError};
use tokio::net::TcpListener;
use tokio::task::JoinHandle;
use tokio_stream::wrappers::TcpListenerStream;
use tonic::service::Routes;
use tonic::transport::Server;
use url::form_urlencoded;
use yoto_server::clock::{Clock, SystemClock};

/// Whom the issuer signs in, and how it errs.
#[derive(Debug, Clone)]
pub(super) struct Person {
    claims: Value,
    /// In place of the one of the request.
    pub nonce: Option<String>,
    /// For whom the token is.
    pub audience: String,
    /// In place of this issuer.
    pub issuer: Option<String>,
    /// Seconds until the token ends.
    pub seconds: i64,
    /// Whether the signature is that of the token.
    pub signed: bool,
}

impl Person {
    /// One with a subject and more claims.
    pub(super) fn new(subject: &str, mut claims: Value) -> Self {
        claims["sub"] = json!(subject);
        Self {
            claims,
            nonce: None,
            audience: "yoto".to_owned(),
            issuer: None,
            seconds: 300,
            signed: true,
        }
    }
}

/// A code that was given out.
struct Given {
    person: Person,
    nonce: String,
    challenge: String,
    back: String,
}

struct Shared {
    url: String,
    key: Mutex<Key>,
    expected: Mutex<Option<Person>>,
    given: Mutex<HashMap<String, Given>>,
}

/// A key with its id.
struct Key {
    id: String,
    pair: EcdsaKeyPair,
}

impl Key {
    fn new(id: &str) -> Self {
        let random = SystemRandom::new();
        let algorithm = &ECDSA_P256_SHA256_FIXED_SIGNING;
        let pair = EcdsaKeyPair::generate_pkcs8(algorithm, &random).expect("a key");
        let pair = EcdsaKeyPair::from_pkcs8(algorithm, pair.as_ref(), &random).expect("a key");
        let id = id.to_owned();
        Self { id, pair }
    }
}

/// The issuer.
pub(super) struct Issuer {
    /// Its URL.
    pub url: String,
    address: SocketAddr,
    shared: Arc<Shared>,
    serving: JoinHandle<()>,
}

impl Issuer {
    pub(super) async fn start() -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("binds");
        let address = listener.local_addr().expect("has an address");
        let url = format!("http://{address}");
        let shared = Arc::new(Shared {
            url: url.clone(),
            key: Mutex::new(Key::new("1")),
            expected: Mutex::default(),
            given: Mutex::default(),
        });
        let router = Router::new()
            .route("/.well-known/openid-configuration", get(description))
            .route("/keys", get(keys))
            .route("/authorize", get(authorize))
            .route("/token", post(token))
            .with_state(Arc::clone(&shared));
        let server = Server::builder().accept_http1(true);
        let serving = tokio::spawn(async move {
            let incoming = TcpListenerStream::new(listener);
            let served = { server }
                .add_routes(Routes::from(router))
                .serve_with_incoming(incoming);
            served.await.expect("serves");
        });
        Self {
            url,
            address,
            shared,
            serving,
        }
    }

    /// Signs with a new key from now on, and names no other.
    pub(super) fn rotate(&self, id: &str) {
        *lock(&self.shared.key) = Key::new(id);
    }

    /// Who signs in next.
    pub(super) fn expect(&self, person: Person) {
        *lock(&self.shared.expected) = Some(person);
    }

    /// Goes where a browser is sent: the address to which it is sent back.
    pub(super) async fn visit(&self, url: &str) -> String {
        let path = url.strip_prefix(&self.url).expect("the issuer's");
        let (_, head, _) = ask_with(self.address, "GET", path, "", "").await;
        let place = head.lines().find_map(|it| it.strip_prefix("location: "));
        place.expect("a redirection").trim().to_owned()
    }

    pub(super) async fn stop(self) {
        self.serving.abort();
        let _ = self.serving.await;
    }
}

fn lock<T>(shared: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

fn answer(value: &Value) -> Response {
    ([(CONTENT_TYPE, "application/json")], value.to_string()).into_response()
}

fn fields(text: &str) -> impl Fn(&str) -> String + use<> {
    let all = form_urlencoded::parse(text.as_bytes()).into_owned();
    let all: HashMap<String, String> = all.collect();
    move |name| all.get(name).cloned().unwrap_or_default()
}

async fn description(State(shared): State<Arc<Shared>>) -> Response {
    let url = &shared.url;
    answer(&json!({
        "issuer": url,
        "authorization_endpoint": format!("{url}/authorize"),
        "token_endpoint": format!("{url}/token"),
        "jwks_uri": format!("{url}/keys"),
        "response_types_supported": ["code"],
        "subject_types_supported": ["public"],
        "id_token_signing_alg_values_supported": ["ES256"],
    }))
}

async fn keys(State(shared): State<Arc<Shared>>) -> Response {
    let key = lock(&shared.key);
    let point = key.pair.public_key().as_ref();
    let (x, y) = point[1..].split_at(32);
    let text = |bytes: &[u8]| URL_SAFE_NO_PAD.encode(bytes);
    answer(&json!({"keys": [
        {"kty": "EC", "crv": "P-256", "alg": "ES256", "use": "sig", "kid": key.id, "x": text(x), "y": text(y)},
    ]}))
}

async fn authorize(State(shared): State<Arc<Shared>>, RawQuery(query): RawQuery) -> Redirect {
    let field = fields(&query.unwrap_or_default());
    assert_eq!(
        (field("client_id"), field("response_type")),
        ("yoto".to_owned(), "code".to_owned())
    );
    assert_eq!(field("code_challenge_method"), "S256");
    assert!(field("scope").contains("openid"), "{}", field("scope"));
    let person = lock(&shared.expected).take().expect("somebody is expected");
    let given = Given {
        person,
        nonce: field("nonce"),
        challenge: field("code_challenge"),
        back: field("redirect_uri"),
    };
    let code = uuid::Uuid::new_v4().simple().to_string();
    let back = format!("{}?code={code}&state={}", given.back, field("state"));
    lock(&shared.given).insert(code, given);
    Redirect::to(&back)
}

async fn token(State(shared): State<Arc<Shared>>, body: String) -> Response {
    let field = fields(&body);
    let given = lock(&shared.given).remove(&field("code"));
    let verifier = URL_SAFE_NO_PAD.encode(Sha256::digest(field("code_verifier").as_bytes()));
    let known = given.filter(|it| it.challenge == verifier && it.back == field("redirect_uri"));
    let Some(given) = known else {
        let refused = answer(&json!({"error": "invalid_grant"}));
        return (StatusCode::BAD_REQUEST, refused).into_response();
    };
    let token = shared.token(&given);
    answer(&json!({"access_token": "a", "token_type": "Bearer", "id_token": token}))
}

impl Shared {
    fn token(&self, given: &Given) -> String {
        let person = &given.person;
        let now = SystemClock.now() as i64;
        let mut claims = person.claims.clone();
        claims["iss"] = json!(person.issuer.as_ref().unwrap_or(&self.url));
        claims["aud"] = json!(person.audience);
        claims["nonce"] = json!(person.nonce.as_ref().unwrap_or(&given.nonce));
        claims["iat"] = json!(now);
        claims["exp"] = json!(now + person.seconds);
        let text = |value: &Value| URL_SAFE_NO_PAD.encode(value.to_string());
        let key = lock(&self.key);
        let body = format!(
            "{}.{}",
            text(&json!({"alg": "ES256", "kid": key.id})),
            text(&claims)
        );
        let signed = match person.signed {
            true => body.clone(),
            false => format!("{body}x"),
        };
        let signature = key.pair.sign(&SystemRandom::new(), signed.as_bytes());
        let signature = signature.expect("signs");
        format!("{body}.{}", URL_SAFE_NO_PAD.encode(signature.as_ref()))
    }
}
