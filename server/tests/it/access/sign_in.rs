//! Sign-in of people in a browser: by a key, and at an issuer of OpenID Connect, which runs in this process.

use super::issuer::{Issuer, Person};
use crate::dashboard::browser::Browser;
use crate::support::{Service, ask_with, eventually, listen_as};
use std::net::SocketAddr;
use tokio::net::TcpListener;
use yoto_proto::v1::{ListKeysRequest, Scope};
use yoto_server::{Admission, OidcConfig};

/// What a browser sends with a click on a link of another site.
const CLICK: &str =
    "Sec-Fetch-Site: cross-site\r\nSec-Fetch-Mode: navigate\r\nSec-Fetch-Dest: document\r\n";

/// A service whose people sign in at `issuer`.
async fn start(issuer: &Issuer) -> (Service, SocketAddr) {
    let service = start_at(issuer, "http://localhost:50051").await;
    let (address, _) = listen_as(&service, Admission::Machine).await;
    (service, address)
}

/// One that browsers reach at `reached`.
async fn start_at(issuer: &Issuer, reached: &str) -> Service {
    let config: OidcConfig = serde_json::from_value(serde_json::json!({
        "issuer": issuer.url,
        "client_id": "yoto",
        "address": reached,
        "grant": [
            {"claim": "email", "value": "eve@example.org", "tenant": "film", "scopes": ["read"]},
            {"claim": "email", "value": "*@example.org", "tenant": "default", "scopes": ["read", "write"]},
            {"claim": "groups", "value": "operators", "tenant": "default", "scopes": ["read", "operate"]},
        ],
    }))
    .expect("settings");
    Service::start_with(move |it| it.oidc = Some(config.clone())).await
}

/// The pair of the cookie with this name in the head of an answer.
fn cookie(head: &str, name: &str) -> Option<String> {
    let mut lines = head
        .lines()
        .filter_map(|it| it.strip_prefix("set-cookie: "));
    let line = lines.find(|it| it.starts_with(&format!("{name}=")))?;
    line.split(';').next().map(str::to_owned)
}

fn location(head: &str) -> &str {
    let line = head.lines().find_map(|it| it.strip_prefix("location: "));
    line.unwrap_or_default().trim()
}

/// Begins a sign-in as `person`: the cookie that the browser is told, and the path to which the issuer sends it back.
async fn begin(address: SocketAddr, issuer: &Issuer, person: Person) -> (String, String) {
    issuer.expect(person);
    let start = "/sign-in/start?to=%2Fjobs&here=1";
    let (status, head, body) = ask_with(address, "GET", start, "", "").await;
    assert_eq!(status, 303, "{body}");
    let begun = cookie(&head, "yoto-sign-in").expect("a cookie");
    let back = issuer.visit(location(&head)).await;
    let path = back.strip_prefix("http://localhost:50051");
    (begun, path.expect("this service").to_owned())
}

/// Goes to the issuer as `person` and back: status, head and body of the answer.
async fn sign_in(address: SocketAddr, issuer: &Issuer, person: Person) -> (u16, String, String) {
    let (begun, path) = begin(address, issuer, person).await;
    let headers = format!("Cookie: {begun}\r\n{CLICK}");
    ask_with(address, "GET", &path, &headers, "").await
}

fn ada() -> Person {
    Person::new(
        "7",
        serde_json::json!({"email": "ada@example.org", "email_verified": true}),
    )
}

#[tokio::test]
async fn somebody_whom_the_issuer_vouches_for_signs_in_and_out() {
    let issuer = Issuer::start().await;
    let (service, address) = start(&issuer).await;
    // Nobody is let in before: there is no key, but people sign in.
    let (status, _, page) = ask_with(address, "GET", "/people", "", "").await;
    assert_eq!(status, 401);
    assert!(page.contains("Sign in with 127.0.0.1"), "{page}");
    assert!(!page.contains("YOTO_KEY"), "{page}");
    // From an address at which the issuer's answer would not arrive.
    let (_, head, _) = ask_with(address, "GET", "/sign-in/start?to=%2Fjobs", "", "").await;
    let there = "http://localhost:50051/sign-in/start?to=%2Fjobs&here=1";
    assert_eq!(location(&head), there);
    let (status, head, body) = sign_in(address, &issuer, ada()).await;
    assert_eq!((status, location(&head)), (303, "/jobs"), "{body}");
    let session = cookie(&head, "yoto-session").expect("a session");
    assert!(
        head.contains("HttpOnly; SameSite=Lax; Max-Age=43200"),
        "{head}"
    );
    let with = format!("Cookie: a=b; {session}\r\n");
    // After the way back from the issuer, and after a click.
    for more in ["", CLICK] {
        let answer = ask_with(address, "GET", "/jobs", &format!("{with}{more}"), "").await;
        assert_eq!(answer.0, 200, "{}", answer.2);
    }
    // Another site's frame, script or form is refused, and so is a call: a browser sends the cookie with them.
    for foreign in [
        "Sec-Fetch-Site: cross-site\r\nSec-Fetch-Mode: navigate\r\nSec-Fetch-Dest: iframe\r\n",
        "Sec-Fetch-Site: cross-site\r\n",
        "Origin: https://evil.example\r\n",
    ] {
        let answer = ask_with(address, "GET", "/jobs", &format!("{with}{foreign}"), "").await;
        assert_eq!(answer.0, 403, "{foreign}");
    }
    assert_eq!(ask_with(address, "GET", "/v1/jobs", &with, "").await.0, 401);
    // She may write, but not operate.
    let (_, _, page) = ask_with(address, "GET", "/service", &with, "").await;
    assert!(page.contains("signed in: ada@example.org (7)"), "{page}");
    let keys = service.keys().list_keys(ListKeysRequest::default()).await;
    let keys = keys.expect("lists").into_inner().keys;
    assert_eq!(keys.len(), 1);
    assert_eq!(
        keys[0].scopes,
        [i32::from(Scope::Read), i32::from(Scope::Write)]
    );
    let token = page
        .split("name=\"token\" value=\"")
        .nth(1)
        .expect("a form");
    let token = token.split('"').next().expect("a token");
    let form = format!("token={token}");
    let kind = format!("{with}Content-Type: application/x-www-form-urlencoded\r\n");
    assert_eq!(
        ask_with(address, "POST", "/sign-out", &kind, "token=x")
            .await
            .0,
        403
    );
    let (status, head, _) = ask_with(address, "POST", "/sign-out", &kind, &form).await;
    assert_eq!((status, location(&head)), (303, "/sign-in"));
    assert_eq!(
        cookie(&head, "yoto-session").as_deref(),
        Some("yoto-session=")
    );
    let (status, _, page) = ask_with(address, "GET", "/jobs?a=1", &with, "").await;
    assert_eq!(status, 401);
    assert!(page.contains("was revoked"), "{page}");
    assert!(page.contains("name=\"to\" value=\"/jobs?a=1\""), "{page}");
}

#[tokio::test]
async fn grants_say_who_has_which_tenant() {
    let issuer = Issuer::start().await;
    let (service, address) = start(&issuer).await;
    let person = |claims| Person::new("8", claims);
    let eve = person(serde_json::json!({"email": "eve@example.org", "email_verified": true}));
    assert_eq!(sign_in(address, &issuer, eve).await.0, 303);
    let of_film = ListKeysRequest {
        tenant: "film".to_owned(),
        ..ListKeysRequest::default()
    };
    let keys = service.keys().list_keys(of_film).await.expect("lists");
    assert_eq!(
        keys.into_inner().keys[0].display_name,
        "signed in: eve@example.org (8)"
    );
    let operator = person(serde_json::json!({"groups": ["staff", "operators"]}));
    assert_eq!(sign_in(address, &issuer, operator).await.0, 303);
    for stranger in [
        serde_json::json!({"email": "ada@example.org", "email_verified": false}),
        serde_json::json!({"email": "ada@example.net", "email_verified": true}),
        serde_json::json!({"groups": "staff"}),
    ] {
        let (status, head, page) = sign_in(address, &issuer, person(stranger.clone())).await;
        assert_eq!(status, 403, "{stranger}: {page}");
        assert_eq!(cookie(&head, "yoto-session"), None);
        assert!(page.contains("has no access to this service"), "{page}");
    }
}

#[tokio::test]
async fn somebody_has_a_number_of_sessions_and_a_browser_has_one() {
    let issuer = Issuer::start().await;
    let (service, address) = start(&issuer).await;
    let mut cookies = Vec::new();
    for _ in 0..22 {
        let (_, head, _) = sign_in(address, &issuer, ada()).await;
        cookies.push(cookie(&head, "yoto-session").expect("a session"));
    }
    let live = async || {
        let all = ListKeysRequest {
            page_size: 100,
            ..ListKeysRequest::default()
        };
        let keys = service.keys().list_keys(all).await.expect("lists");
        let keys = keys.into_inner().keys;
        keys.iter().filter(|it| it.revoke_time.is_none()).count()
    };
    assert_eq!(live().await, 20);
    let asked = async |cookie: &str| {
        let with = format!("Cookie: {cookie}\r\n");
        ask_with(address, "GET", "/jobs", &with, "").await.0
    };
    assert_eq!(asked(&cookies[0]).await, 401);
    assert_eq!(asked(&cookies[21]).await, 200);
    // The same browser signs in again: its earlier session ends.
    let (begun, path) = begin(address, &issuer, ada()).await;
    let with = format!("Cookie: {begun}; {}\r\n", cookies[21]);
    let answer = ask_with(address, "GET", &path, &with, "").await;
    assert_eq!(answer.0, 303, "{}", answer.2);
    assert_eq!(asked(&cookies[21]).await, 401);
    assert_eq!(live().await, 19);
}

#[tokio::test]
async fn a_token_that_was_made_for_something_else_lets_nobody_in() {
    let issuer = Issuer::start().await;
    let (service, address) = start(&issuer).await;
    type Wrong = (&'static str, fn(&mut Person));
    let wrong: [Wrong; 5] = [
        ("nonce", |it| it.nonce = Some("another".to_owned())),
        ("audience", |it| it.audience = "other".to_owned()),
        ("issuer", |it| {
            it.issuer = Some("https://evil.example".to_owned())
        }),
        ("time", |it| it.seconds = -600),
        ("signature", |it| it.signed = false),
    ];
    for (what, change) in wrong {
        let mut person = ada();
        change(&mut person);
        let (status, head, page) = sign_in(address, &issuer, person).await;
        assert_eq!(status, 502, "{what}: {page}");
        assert_eq!(cookie(&head, "yoto-session"), None, "{what}");
    }
    // Without the cookie of who has begun, with another state, and without a code.
    let (begun, path) = begin(address, &issuer, ada()).await;
    let with = format!("Cookie: {begun}\r\n");
    let (_, query) = path.split_once('?').expect("a query");
    let state = query
        .split('&')
        .find(|it| it.starts_with("state="))
        .expect("a state");
    for (path, headers, status) in [
        (path.clone(), "", 400),
        ("/sign-in/back?code=1&state=x".to_owned(), &*with, 400),
        (
            format!("/sign-in/back?error=access_denied&{state}"),
            &*with,
            403,
        ),
    ] {
        let answer = ask_with(address, "GET", &path, headers, "").await;
        assert_eq!(answer.0, status, "{path}: {}", answer.2);
    }
    assert_eq!(ask_with(address, "GET", &path, &with, "").await.0, 303);
    // A code is used once.
    assert_eq!(ask_with(address, "GET", &path, &with, "").await.0, 502);
    let keys = service.keys().list_keys(ListKeysRequest::default()).await;
    assert_eq!(keys.expect("lists").into_inner().keys.len(), 1);
}

#[tokio::test]
async fn keys_that_the_issuer_changes_and_clocks_that_differ_keep_nobody_out() {
    let issuer = Issuer::start().await;
    let (_service, address) = start(&issuer).await;
    let signs_in = async |person: Person| {
        let (status, head, page) = sign_in(address, &issuer, person).await;
        (status, cookie(&head, "yoto-session").is_some(), page)
    };
    let (status, has_session, page) = signs_in(ada()).await;
    assert_eq!((status, has_session), (303, true), "{page}");
    // The service has read the old key just now, and the code of this sign-in counts once.
    issuer.rotate("2");
    let (status, has_session, page) = signs_in(ada()).await;
    assert_eq!((status, has_session), (303, true), "{page}");
    // Another key under the id of the last one.
    issuer.rotate("2");
    let (status, has_session, page) = signs_in(ada()).await;
    assert_eq!((status, has_session), (303, true), "{page}");
    // The coordinator's clock is ahead by more than the time of a token.
    for (seconds, lets_in) in [(-30, true), (-90, false)] {
        let mut person = ada();
        person.seconds = seconds;
        let (status, has_session, page) = signs_in(person).await;
        let expected = (if lets_in { 303 } else { 502 }, lets_in);
        assert_eq!((status, has_session), expected, "{seconds} s: {page}");
    }
}

#[tokio::test]
async fn an_issuer_that_is_away_is_told_and_keys_still_count() {
    let issuer = Issuer::start().await;
    let (service, address) = start(&issuer).await;
    let reader = service.key("default", &[Scope::Read]).await;
    issuer.stop().await;
    let (status, _, page) = ask_with(address, "GET", "/sign-in/start?here=1", "", "").await;
    assert_eq!(status, 502);
    assert!(
        page.contains("127.0.0.1 has not signed anybody in"),
        "{page}"
    );
    let form = format!("key={}&to=%2Fmodels", reader.text);
    let (status, head, _) = ask_with(address, "POST", "/sign-in/key", "", &form).await;
    assert_eq!((status, location(&head)), (303, "/models"));
}

#[tokio::test]
async fn a_key_is_written_into_the_page_that_asks_for_it() {
    let service = Service::start().await;
    let reader = service.key("default", &[Scope::Read]).await;
    let (address, _) = listen_as(&service, Admission::Machine).await;
    let (status, head, page) = ask_with(address, "GET", "/people", "", "").await;
    assert_eq!(status, 401);
    assert!(head.contains("www-authenticate: Bearer") && head.contains("content-security-policy"));
    assert!(page.contains("name=\"to\" value=\"/people\"") && !page.contains("Sign in with"));
    let send = |key: &str, headers: &'static str| {
        let form = format!("key={key}&to=%2Fpeople");
        async move { ask_with(address, "POST", "/sign-in/key", headers, &form).await }
    };
    let (status, head, page) = send("yoto_0", "").await;
    assert_eq!((status, cookie(&head, "yoto-session")), (401, None));
    assert!(page.contains("does not know this key"), "{page}");
    assert_eq!(
        send(&reader.text, "Sec-Fetch-Site: cross-site\r\n").await.0,
        403
    );
    let foreign = send(&reader.text, "Origin: https://evil.example\r\n").await;
    assert_eq!((foreign.0, cookie(&foreign.1, "yoto-session")), (403, None));
    let encrypted = format!("Origin: https://{address}\r\n").leak();
    let (status, head, _) = send(&reader.text, encrypted).await;
    assert_eq!((status, location(&head)), (303, "/people"));
    assert!(
        head.contains("SameSite=Lax; Secure") && !head.contains("Max-Age"),
        "{head}"
    );
    let session = cookie(&head, "__Host-yoto-session").expect("a session");
    let with = format!("Cookie: {session}\r\n");
    assert_eq!(ask_with(address, "GET", "/people", &with, "").await.0, 200);
    // Leaving ends the session in the browser; the key is its owner's.
    let (_, _, page) = ask_with(address, "GET", "/service", &with, "").await;
    let token = page
        .split("name=\"token\" value=\"")
        .nth(1)
        .expect("a form");
    let token = token.split('"').next().expect("a token");
    let kind = format!("{with}Content-Type: application/x-www-form-urlencoded\r\n");
    let left = ask_with(
        address,
        "POST",
        "/sign-out",
        &kind,
        &format!("token={token}"),
    )
    .await;
    assert_eq!(left.0, 303, "{}", left.2);
    assert_eq!(ask_with(address, "GET", "/people", &with, "").await.0, 200);
    service.revoke(&reader.name).await;
    let refused = || async {
        let answer = ask_with(address, "GET", "/people", &with, "").await;
        (answer.0 == 401).then_some(())
    };
    eventually("the end of the session", refused).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_browser_goes_to_the_issuer_and_back() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let issuer = Issuer::start().await;
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("binds");
    let port = listener.local_addr().expect("an address").port();
    // Another site than the issuer's.
    let reached = format!("http://localhost:{port}");
    let service = start_at(&issuer, &reached).await;
    let incoming = yoto_server::tcp(listener);
    let serving =
        (service.coordinator).serve_to(Admission::Machine, incoming, std::future::pending());
    tokio::spawn(serving);
    issuer.expect(ada());
    let driven = tokio::task::spawn_blocking(move || {
        let go = serde_json::json!({"url": format!("{reached}/people")});
        browser.call("Page.navigate", go);
        browser.until("document.querySelector('a.button').textContent.startsWith('Sign in with')");
        browser.of("document.querySelector('a.button').click()");
        browser.until("location.pathname === '/people' && document.querySelector('h1').textContent === 'People'");
        // The stream of events is answered too.
        browser.until("document.getElementById('live').textContent === 'live'");
        browser.of("location.assign('/service')");
        browser
            .until("document.querySelector('#signed-in').textContent.includes('ada@example.org')");
        browser.of("document.querySelector('#signed-in button').click()");
        browser.until("location.pathname === '/sign-in'");
        browser.of("location.assign('/people')");
        browser.until("document.querySelector('h1').textContent === 'Sign in'");
    });
    driven.await.expect("the browser signs in");
}
