//! The pages for people: what they show, whom they answer, what their forms change, and how they follow changes.

pub(crate) mod browser;
mod crowd;
mod events;
pub(crate) mod forms;
mod packing;
mod report;
mod sending;
pub(crate) mod stage;
mod statements;
mod upload;

use crate::support::{ask, ask_with, id, listen, listen_for};
use stage::{HOSTILE, Stage};
use std::collections::BTreeMap;
use std::net::SocketAddr;
use yoto_server::Tenant;

/// Addresses in the attributes `href` and `src` of a page.
fn links(page: &str) -> Vec<String> {
    let mut found = Vec::new();
    for attribute in [" href=\"", " src=\""] {
        let parts = page.split(attribute).skip(1);
        let values = parts.filter_map(|rest| rest.split('"').next());
        found.extend(values.map(|it| it.replace("&amp;", "&")));
    }
    found
}

/// All pages and files that can be reached from the first page by links, with their headers and bodies.
async fn reached(address: SocketAddr) -> BTreeMap<String, (String, String)> {
    let mut known = BTreeMap::new();
    let mut waiting = vec!["/".to_owned()];
    while let Some(path) = waiting.pop() {
        // What a page has in itself needs no request.
        let own = path.starts_with('#') || path.starts_with("data:");
        if own || known.contains_key(&path) {
            continue;
        }
        assert!(
            path.starts_with('/') && !path.starts_with("//"),
            "{path} leads away"
        );
        let (status, head, body) = ask(address, "GET", &path).await;
        assert_eq!(status, 200, "{path}: {body}");
        if head.contains("text/html") {
            waiting.extend(links(&body));
        }
        known.insert(path, (head, body));
    }
    known
}

#[tokio::test]
async fn all_links_lead_somewhere_and_nothing_that_others_wrote_is_markup() {
    let stage = Stage::set().await;
    let (address, serving) = listen(&stage.service).await;
    let pages = reached(address).await;
    let subject = format!("/people/{}", id(&stage.subject.name));
    let (model, failed) = (
        format!("/{}", stage.model.name),
        format!("/{}", stage.failed),
    );
    let render = format!("/{}/files/000000%2Epng", stage.render);
    let thumbnail = format!("/{}/thumbnail.png?of=", stage.subject.captures[0]);
    for path in [
        "/", "/people", "/models", "/jobs", "/workers", "/service", &subject, &model, &failed,
        &render,
    ] {
        assert!(pages.contains_key(path), "{path} among {:?}", pages.keys());
    }
    let thumbnail = pages.iter().find(|(path, _)| path.starts_with(&thumbnail));
    let (head, body) = thumbnail.expect("a thumbnail").1;
    assert!(
        head.contains("content-type: image/png") && body == "picture",
        "{head}"
    );
    for (path, (head, body)) in &pages {
        assert!(head.contains("content-security-policy: "), "{path}: {head}");
        assert!(
            head.contains("x-content-type-options: nosniff"),
            "{path}: {head}"
        );
        if !head.contains("text/html") {
            continue;
        }
        assert!(
            head.contains("default-src 'none'") && !head.contains("unsafe"),
            "{path}: {head}"
        );
        for bad in [
            "<script>",
            "<img src=x",
            " style=",
            "javascript:",
            "\u{202e}",
            "\u{1b}",
        ] {
            assert!(!body.contains(bad), "{path} has {bad}: {body}");
        }
    }
    let shown = |path: &str, text: &str| {
        let body = &pages[path].1;
        assert!(body.contains(text), "{path} has no {text}: {body}");
    };
    for path in [
        "/", "/people", "/models", "/jobs", &subject, &model, &failed,
    ] {
        shown(path, "&lt;script&gt;");
    }
    shown(&subject, "view coverage");
    shown(&subject, "turn &lt;b&gt;once");
    shown(&model, "class=\"chart\"");
    shown(&model, "PSNR on held-out frames");
    shown(&failed, "\\u{202e}");
    shown(&failed, "Queue it again");
    shown("/workers", "\\u{202e}gpu");
    shown("/service", "ready");
    shown("/service", "Used by the tenant default");
    // What is hostile about the names is what they say, and not that they are absent.
    assert!(
        pages["/people"]
            .1
            .contains(&HOSTILE.replace('<', "&lt;").replace('>', "&gt;"))
    );
    serving.abort();
}

#[tokio::test]
async fn pages_answer_get_and_head_alone_and_unknown_names_are_not_found() {
    let stage = Stage::set().await;
    let (address, serving) = listen(&stage.service).await;
    for path in ["/", "/people", "/models", "/jobs", "/workers", "/service"] {
        let (status, _, body) = ask(address, "HEAD", path).await;
        assert_eq!((status, body.as_str()), (200, ""), "{path}");
        assert_eq!(ask(address, "POST", path).await.0, 405, "{path}");
        assert_eq!(ask(address, "DELETE", path).await.0, 405, "{path}");
    }
    assert_eq!(ask(address, "GET", "/workers/cordon").await.0, 405);
    let unknown = "00000000-0000-4000-8000-000000000000";
    for part in ["people", "models", "jobs"] {
        let (status, head, body) = ask(address, "GET", &format!("/{part}/{unknown}")).await;
        assert_eq!(status, 404, "{part}");
        assert!(
            head.contains("text/html") && body.contains("does not exist"),
            "{body}"
        );
        let (status, _, body) = ask(address, "GET", &format!("/{part}/%3Cscript%3E")).await;
        assert!(status == 400 || status == 404, "{status}");
        assert!(!body.contains("<script>"), "{body}");
    }
    assert_eq!(ask(address, "GET", "/assets/page.css").await.0, 404);
    assert_eq!(ask(address, "GET", "/jobs?page=zz").await.0, 400);
    assert_eq!(ask(address, "GET", "/events?job=nothing").await.0, 404);
    assert_eq!(ask(address, "GET", "/events?job=No%20id").await.0, 400);
    let none = format!("/captures/{unknown}/thumbnail.png");
    assert_eq!(ask(address, "GET", &none).await.0, 404);
    serving.abort();
}

#[tokio::test]
async fn two_models_are_compared() {
    let stage = Stage::set().await;
    let (address, serving) = listen(&stage.service).await;
    let (_, _, models) = ask(address, "GET", "/models").await;
    assert!(!models.contains("/compare"), "{models}");
    let other = stage.service.model("plain").await;
    let (_, _, models) = ask(address, "GET", "/models").await;
    assert!(models.contains("href=\"/compare\""), "{models}");
    let (status, _, form) = ask(address, "GET", "/compare").await;
    assert_eq!(status, 200, "{form}");
    assert_eq!(form.matches("<option").count(), 4, "{form}");
    assert!(
        !form.contains("class=\"chart\"") && !form.contains("<script>"),
        "{form}"
    );
    let path = format!(
        "/compare?one={}&other={}",
        id(&other.name),
        id(&stage.model.name)
    );
    let (status, _, page) = ask(address, "GET", &path).await;
    assert_eq!(status, 200, "{page}");
    for shown in [
        "<td><bdi>–</bdi></td><td><bdi>30</bdi></td>",
        "PSNR on held-out frames over time, dB, seconds: 21.00 at 10, 23.00 at 30",
        "&lt;script&gt;",
        "/files/000000%2Epng",
        " selected>plain",
    ] {
        assert!(page.contains(shown), "{shown}: {page}");
    }
    assert!(!page.contains("figures of different people"), "{page}");
    let unknown = "00000000-0000-4000-8000-000000000000";
    let path = format!("/compare?one={}&other={unknown}", id(&other.name));
    assert_eq!(ask(address, "GET", &path).await.0, 404);
    assert_eq!(
        ask(address, "GET", "/compare?one=%3Cb%3E&other=x").await.0,
        400
    );
    serving.abort();
}

#[tokio::test]
async fn what_is_another_tenants_is_not_found() {
    let stage = Stage::set().await;
    let other = Tenant::new("other").expect("an id");
    let (address, serving) = listen_for(&stage.service, other).await;
    let subject = format!("/people/{}", id(&stage.subject.name));
    let capture = format!("/{}/thumbnail.png", stage.subject.captures[0]);
    let compare = format!("/compare?one={0}&other={0}", id(&stage.model.name));
    let paths = [
        compare,
        subject,
        capture,
        format!("/{}", stage.model.name),
        format!("/{}", stage.failed),
        format!("/{}/files/000000.png", stage.render),
        format!("/events?job={}", id(&stage.failed)),
        format!("/events?model={}", id(&stage.model.name)),
    ];
    for path in paths {
        let (status, _, body) = ask(address, "GET", &path).await;
        assert_eq!(status, 404, "{path}: {body}");
    }
    for path in ["/", "/people", "/models", "/jobs", "/workers"] {
        let (status, _, body) = ask(address, "GET", path).await;
        assert_eq!(status, 200, "{path}");
        assert!(!body.contains("script&gt;"), "{path}: {body}");
    }
    // Nor can its forms change anything: with its own token it finds no such job.
    let own = forms::token(address, "/workers").await;
    let cancel = format!("/{}/cancel", stage.running);
    let body = format!("token={own}");
    let answer = ask_with(address, "POST", &cancel, forms::FORM, &body).await;
    assert_eq!(answer.0, if own.is_empty() { 403 } else { 404 });
    serving.abort();
}

#[tokio::test]
async fn a_player_has_an_origin_of_its_own() {
    let stage = Stage::set().await;
    let export = stage.export("ada.html", b"<script>1</script>").await;
    let (address, serving) = listen(&stage.service).await;
    for page in [&export, &stage.model.name] {
        let (status, _, page) = ask(address, "GET", &format!("/{page}")).await;
        assert_eq!(status, 200);
        let frame = page
            .split("<iframe")
            .nth(1)
            .and_then(|it| it.split('>').next());
        let frame = frame.expect("a player");
        assert!(frame.contains("sandbox=\"allow-scripts\""), "{frame}");
    }
    let (_, head, body) = ask(address, "GET", &format!("/{export}/files/ada.html")).await;
    assert_eq!(body, "<script>1</script>");
    let policy = "content-security-policy: sandbox allow-scripts; default-src 'none'";
    assert!(
        head.contains(policy) && !head.contains("allow-same-origin"),
        "{head}"
    );
    serving.abort();
}

#[tokio::test(flavor = "multi_thread")]
async fn the_camera_of_a_player_becomes_that_of_the_film_that_is_ordered() {
    let Some(mut browser) = browser::Browser::start() else {
        return;
    };
    let stage = Stage::set().await;
    let player = b"<script>
        setInterval(() => parent.postMessage({ yoto: 'camera', azimuth: 33.4, elevation: 99 }, '*'), 20);
    </script>";
    stage.export("ada.html", player).await;
    let (address, serving) = listen(&stage.service).await;
    let page = format!("http://{address}/{}", stage.model.name);
    let driven = tokio::task::spawn_blocking(move || {
        let value = |field: &str| format!("document.querySelector('#film [name={field}]').value");
        browser.call("Page.navigate", serde_json::json!({"url": page}));
        browser
            .until("document.readyState === 'complete' && document.querySelector('iframe.player')");
        assert!(browser.text("#camera").contains("Drag the player"));
        // Only of a player, and only while a film is ordered.
        browser.of("document.querySelector('iframe.player').scrollIntoView()");
        browser.of("new Promise((done) => setTimeout(done, 300))");
        assert_eq!(browser.of(&value("azimuth")), "0");
        browser.of("document.getElementById('film').open = true");
        browser.of("postMessage({ yoto: 'camera', azimuth: 5, elevation: 5 }, '*')");
        let followed = format!(
            "{} === '33' && {} === '80'",
            value("azimuth"),
            value("elevation")
        );
        browser.until(&followed);
    });
    driven.await.expect("the page follows");
    serving.abort();
}
