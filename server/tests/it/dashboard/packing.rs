//! Many small files, which the form that adds a person packs into one archive.

use super::browser::Browser;
use super::sending::{SENT, written};
use crate::support::{Service, listen};
use std::io::Read;
use tempfile::TempDir;

#[tokio::test(flavor = "multi_thread")]
async fn many_small_files_are_sent_as_one_archive_which_goes_on_after_a_reload() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let service = Service::start().await;
    let (address, serving) = listen(&service).await;
    let dir = TempDir::new().expect("a folder");
    let folder = dir.path().join("ada");
    written(&folder, "poses.json", b"{}");
    let pixels = |number: usize| vec![number as u8; 40_000 + number];
    for number in 0..100 {
        written(
            &folder,
            &format!("frames/bäume {number:06}.png"),
            &pixels(number),
        );
    }
    let folder = folder.display().to_string();
    let driven = tokio::task::spawn_blocking(move || {
        browser.open(&format!("http://{address}/people"));
        browser.write("display_name", "Ada");
        browser.drop_onto_form(&[&folder]);
        browser
            .until("document.querySelector('#upload-chosen').textContent.startsWith('101 files')");
        browser.network(Some(1 << 20));
        browser.press("Upload");
        browser.until(&format!(
            "document.querySelector('#upload-says').textContent === 'Sending.' && {SENT} > 0"
        ));
        browser.call("Page.reload", serde_json::json!({}));
        browser
            .until("document.querySelector('#upload-says').textContent.includes('has not ended')");
        assert!(browser.text("#upload-says").contains("the same 101 files"));
        browser.network(None);
        browser.drop_onto_form(&[&folder]);
        browser.until("location.pathname.startsWith('/people/')");
        browser.ranges.split_off(0)
    });
    let ranges = driven.await.expect("the page does its part");
    assert!(ranges.len() < 20, "{} requests", ranges.len());
    let lease = service.ingest_lease().await;
    let archive = service.ingested(&lease, "capture.zip");
    let mut archive = zip::ZipArchive::new(std::io::Cursor::new(archive)).expect("a ZIP");
    assert_eq!(archive.len(), 101);
    for number in [0, 99] {
        let file = archive.by_name(&format!("frames/bäume {number:06}.png"));
        let mut bytes = Vec::new();
        // Compares the CRC-32, too.
        file.expect("is there")
            .read_to_end(&mut bytes)
            .expect("reads");
        assert!(bytes == pixels(number), "{number}");
    }
    serving.abort();
}
