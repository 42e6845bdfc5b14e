//! The form that adds a person, in a browser.

use super::browser::Browser;
use crate::support::{Service, id, listen, listen_as};
use std::path::Path;
use tempfile::TempDir;
use yoto_proto::v1::{ListCapturesRequest, ListSubjectsRequest, Scope, capture, subject};
use yoto_server::Admission;

/// Bytes of a picture that takes several parts.
const LARGE: usize = 5 << 20;
/// Bytes sent so far, for the page.
pub(super) const SENT: &str = "document.querySelector('#upload-sent progress').value";

fn pixels(seed: usize) -> Vec<u8> {
    (0..LARGE)
        .map(|at| (at * 31 + at / 251 + seed) as u8)
        .collect()
}

/// Writes a file below `folder`, and returns its path.
pub(super) fn written(folder: &Path, file: &str, bytes: &[u8]) -> String {
    let path = folder.join(file);
    std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
    std::fs::write(&path, bytes).expect("writes");
    path.display().to_string()
}

/// A capture of two large pictures.
fn capture_in(dir: &Path) -> String {
    let folder = dir.join("ada");
    written(&folder, "poses.json", b"{}");
    written(&folder, ".DS_Store", b"x");
    for (number, seed) in [(0, 1), (1, 2)] {
        let file = format!("frames/{number:06}.png");
        written(&folder, &file, &pixels(seed));
    }
    written(&folder, "masks/000000.png", b"mask");
    folder.display().to_string()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_folder_is_dropped_and_goes_on_after_a_lost_connection_and_a_reload() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let service = Service::start().await;
    let (address, serving) = listen(&service).await;
    let dir = TempDir::new().expect("a folder");
    let folder = capture_in(dir.path());
    let driven = tokio::task::spawn_blocking(move || {
        browser.open(&format!("http://{address}/people"));
        browser.write("display_name", "<b>Ada</b>");
        browser.drop_onto_form(&[&folder]);
        browser.until("document.querySelector('#upload-chosen').textContent.startsWith('4 files')");
        browser.network(Some(2 << 20));
        browser.press("Upload");
        browser.until(&format!(
            "document.querySelector('#upload-says').textContent === 'Sending.' && {SENT} > 2 << 20"
        ));
        browser.network(Some(0));
        browser.until(
            "document.querySelector('#upload-says').textContent.includes('does not answer')",
        );
        browser.network(Some(2 << 20));
        browser.until("document.querySelector('#upload-says').textContent.startsWith('Sending goes on after')");
        browser.until(&format!("{SENT} > 5 << 20"));
        browser.call("Page.reload", serde_json::json!({}));
        browser
            .until("document.querySelector('#upload-says').textContent.includes('has not ended')");
        let asked = browser.text("#upload-says");
        assert!(
            asked.contains("<b>Ada</b>") && asked.contains("the same 4 files"),
            "{asked}"
        );
        // Others are told apart.
        let other = Path::new(&folder).join("masks/000000.png");
        browser.choose(&[other.display().to_string()]);
        browser.until("document.querySelector('#upload-faults').textContent.includes('is not among these files')");
        browser.network(None);
        browser.drop_onto_form(&[&folder]);
        browser.until(
            "location.pathname.startsWith('/people/') && document.readyState === 'complete'",
        );
        browser.until("document.querySelector('h1').textContent.includes('<b>Ada</b>')");
        assert_eq!(browser.of("localStorage.length"), 0);
        browser.ranges.split_off(0)
    });
    let ranges = driven.await.expect("the page does its part");
    // What the service has is not sent again: parts that were cut are, at most one per cut.
    let length = |range: &str| {
        let (first, last) = range
            .strip_prefix("bytes ")?
            .split_once('/')?
            .0
            .split_once('-')?;
        Some(last.parse::<usize>().ok()? + 1 - first.parse::<usize>().ok()?)
    };
    let sent: usize = ranges.iter().filter_map(|it| length(&it.1)).sum();
    assert!(
        (2 * LARGE..3 * LARGE).contains(&sent),
        "{sent} bytes: {ranges:?}"
    );
    let lease = service.ingest_lease().await;
    for (number, seed) in [(0, 1), (1, 2)] {
        let path = format!("frames/{number:06}.png");
        assert!(service.ingested(&lease, &path) == pixels(seed), "{path}");
    }
    serving.abort();
}

#[tokio::test(flavor = "multi_thread")]
async fn what_can_not_be_sent_is_said_before_and_what_the_service_says_is_text() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let service = Service::start().await;
    let taken = service.subject("Eve").await;
    service.upload_good(&taken.name).await;
    let (address, serving) = listen(&service).await;
    let dir = TempDir::new().expect("a folder");
    let folder = dir.path().to_owned();
    let driven = tokio::task::spawn_blocking(move || {
        // A page without TLS has no checksums of the browser.
        let plain = "Object.defineProperty(Crypto.prototype, 'subtle', { get: () => undefined })";
        browser.call(
            "Page.addScriptToEvaluateOnNewDocument",
            serde_json::json!({"source": plain}),
        );
        browser.open(&format!("http://{address}/people"));
        browser.write("display_name", "Eve");
        browser.press("Upload");
        assert!(browser.text("#upload-faults").contains("No file is chosen"));
        let mut told = |files: &[String], words: &str| {
            browser.choose(files);
            browser.until(&format!(
                "document.querySelector('#upload-faults').textContent.includes('{words}')"
            ));
        };
        told(&[written(&folder, "walk.mp4", b"film")], "yoto avatar");
        told(
            &[written(&folder, "poses.json", b"")],
            "poses.json: is empty",
        );
        let many: Vec<String> = (0..500)
            .map(|it| written(&folder, &format!("{it:06}.png"), b"pixels"))
            .collect();
        told(&many, "481 more");
        // A path that the service refuses is shown with its field, and leaves nobody behind.
        browser.drop_onto_form(&[
            &written(&folder, "b/poses.json", b"{}"),
            &written(&folder, "b/<img src=x onerror=alert(1)>.txt", b"x"),
        ]);
        browser.until("document.querySelector('#upload-chosen').textContent.startsWith('2 files')");
        browser.write("display_name", "Bob");
        browser.press("Upload");
        browser.until(
            "document.querySelector('#upload-faults').textContent.includes('].path: <img src=x')",
        );
        assert_eq!(
            browser.of("document.querySelectorAll('#add img').length"),
            0
        );
        browser.write("display_name", "Eve");
        let archive = written(&folder, "eve.tar.gz", &vec![7; 3 << 20]);
        browser.choose(&[archive]);
        browser.until("document.querySelector('#upload-chosen').textContent.includes('eve.tar.gz becomes capture.tar.gz')");
        browser.press("Upload");
        browser.until(
            "document.querySelector('#upload-faults').textContent.includes('of this name already')",
        );
        assert_eq!(
            browser.of("document.querySelector('#add [name=display_name]').ariaInvalid"),
            "true"
        );
        browser.write("display_name", "Bob");
        browser.press("Upload");
        browser.until(
            "location.pathname.startsWith('/people/') && document.readyState === 'complete'",
        );
    });
    driven.await.expect("the page does its part");
    let mut subjects = service.subjects();
    let people = subjects.list_subjects(ListSubjectsRequest::default());
    let people = people.await.expect("lists").into_inner().subjects;
    let names: Vec<&str> = people.iter().map(|it| it.display_name.as_str()).collect();
    assert_eq!(names, ["Eve", "Bob"], "nobody is left behind");
    let found = service.get_capture(&people[1].captures[0]).await;
    assert_eq!(found.state(), capture::State::Ingesting);
    serving.abort();
}

#[tokio::test(flavor = "multi_thread")]
async fn an_upload_is_given_up() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let service = Service::start().await;
    let (address, serving) = listen(&service).await;
    let dir = TempDir::new().expect("a folder");
    let folder = capture_in(dir.path());
    let driven = tokio::task::spawn_blocking(move || {
        browser.open(&format!("http://{address}/people"));
        browser.of("window.confirm = () => true");
        browser.write("display_name", "Ada");
        browser.drop_onto_form(&[&folder]);
        browser.until("document.querySelector('#upload-chosen').textContent.startsWith('4 files')");
        browser.network(Some(1 << 20));
        browser.press("Upload");
        browser.until(&format!(
            "document.querySelector('#upload-says').textContent === 'Sending.' && {SENT} > 0"
        ));
        browser.press("Give it up");
        browser.until(
            "document.querySelector('#upload-says').textContent.includes('nothing of it is kept')",
        );
        assert_eq!(browser.of("localStorage.length"), 0);
        assert_eq!(
            browser.of("document.querySelector('#add button').disabled"),
            false
        );
    });
    driven.await.expect("the page does its part");
    let mut subjects = service.subjects();
    let people = subjects.list_subjects(ListSubjectsRequest::default());
    assert!(
        people
            .await
            .expect("lists")
            .into_inner()
            .subjects
            .is_empty()
    );
    serving.abort();
}

#[tokio::test(flavor = "multi_thread")]
async fn the_end_of_a_key_is_told_and_another_one_goes_on() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let service = Service::start().await;
    let key = async || service.key("default", &[Scope::Read, Scope::Write]).await;
    let (one, two) = (key().await, key().await);
    let (address, serving) = listen_as(&service, Admission::Nobody).await;
    let dir = TempDir::new().expect("a folder");
    let folder = capture_in(dir.path());
    let (ending, told) = tokio::sync::oneshot::channel();
    let driven = tokio::task::spawn_blocking(move || {
        browser.sign_in(&one.text);
        browser.open(&format!("http://{address}/people"));
        browser.write("display_name", "Ada");
        browser.drop_onto_form(&[&folder]);
        browser.until("document.querySelector('#upload-chosen').textContent.startsWith('4 files')");
        browser.network(Some(1 << 20));
        browser.press("Upload");
        browser.until(&format!(
            "document.querySelector('#upload-says').textContent === 'Sending.' && {SENT} > 0"
        ));
        ending.send(one.name).expect("is heard");
        browser.until("document.querySelector('#upload-faults').textContent.includes('revoked')");
        let words = browser.text("#upload-faults");
        assert!(words.contains("Reload the page to sign in"), "{words}");
        browser.sign_in(&two.text);
        browser.network(None);
        browser.open(&format!("http://{address}/people"));
        browser.drop_onto_form(&[&folder]);
        browser.until("location.pathname.startsWith('/people/')");
    });
    service.revoke(&told.await.expect("the page sends")).await;
    driven.await.expect("the page does its part");
    serving.abort();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_film_alone_is_sent_where_a_worker_has_a_pose_model() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let service = Service::start().await;
    let (address, serving) = listen(&service).await;
    let dir = TempDir::new().expect("a folder");
    let film = written(dir.path(), "IMG_7.MOV", b"film");
    let second = written(dir.path(), "second.mp4", b"film");
    let (one, two) = (film.clone(), second);
    let driven = tokio::task::spawn_blocking(move || {
        browser.open(&format!("http://{address}/people"));
        browser.write("display_name", "Ada");
        browser.choose(&[one]);
        browser.until("document.querySelector('#upload-faults').textContent.includes('no worker of this service')");
        browser
    });
    let mut browser = driven.await.expect("the page refuses");
    let worker = service.worker_for_films().await;
    let driven = tokio::task::spawn_blocking(move || {
        browser.call("Page.reload", serde_json::json!({}));
        browser.until("document.readyState === 'complete' && document.querySelector('#add .drop').textContent.includes('Drop a film')");
        browser.write("display_name", "Ada");
        browser.choose(&[film.clone(), two]);
        browser.until("document.querySelector('#upload-faults').textContent.includes('One film makes one person')");
        browser.choose(&[film]);
        browser.until("document.querySelector('#upload-chosen').textContent.includes('IMG_7.MOV becomes video.MOV')");
        browser.press("Upload");
        browser.until(
            "location.pathname.startsWith('/people/') && document.readyState === 'complete'",
        );
    });
    driven.await.expect("the page does its part");
    let lease = service
        .lease(&worker)
        .await
        .expect("the ingest of the film");
    assert_eq!(service.ingested(&lease, "video.MOV"), b"film");
    serving.abort();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_further_capture_is_sent_from_the_page_of_its_person_and_given_up_alone() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let (address, serving) = listen(&service).await;
    let dir = TempDir::new().expect("a folder");
    let folder = capture_in(dir.path());
    let page = format!("http://{address}/people/{}", id(&ada.name));
    let driven = tokio::task::spawn_blocking(move || {
        browser.open(&page);
        browser.drop_onto_form(&[&folder]);
        browser.until("document.querySelector('#upload-chosen').textContent.startsWith('4 files')");
        browser.network(Some(2 << 20));
        browser.press("Upload");
        browser.until(&format!(
            "document.querySelector('#upload-says').textContent === 'Sending.' && {SENT} > 2 << 20"
        ));
        browser
    });
    let browser = driven.await.expect("the page sends");
    let captures = async || {
        let request = ListCapturesRequest {
            parent: ada.name.clone(),
            ..ListCapturesRequest::default()
        };
        let listed = service.subjects().list_captures(request).await;
        listed.expect("lists").into_inner().captures
    };
    let states: Vec<capture::State> = captures().await.iter().map(|it| it.state()).collect();
    assert_eq!(states.len(), 2, "{states:?}");
    assert!(states.contains(&capture::State::Uploading), "{states:?}");
    let driven = tokio::task::spawn_blocking(move || {
        let mut browser = browser;
        browser.of("window.confirm = () => true");
        browser.press("Give it up");
        browser
            .until("document.querySelector('#upload-says').textContent.includes('was given up')");
        assert_eq!(browser.of("localStorage.length"), 0);
    });
    driven.await.expect("the page gives it up");
    let states: Vec<capture::State> = captures().await.iter().map(|it| it.state()).collect();
    assert_eq!(states, [capture::State::Ready]);
    let left = service.get_subject(&ada.name).await;
    assert_eq!(left.state(), subject::State::Ready);
    serving.abort();
}
