//! Bytes of files over HTTP.

use super::{get, send};
use crate::dashboard::stage::Stage;
use crate::support::{Service, ask_with, file, listen};
use serde_json::json;

#[tokio::test]
async fn a_capture_is_uploaded_in_parts_and_goes_on_where_it_stopped() {
    let service = Service::start().await;
    let (address, _serving) = listen(&service).await;
    let subject = service.subject("Ada").await;
    let files = [
        file("poses.json", b"{}"),
        file("frames/000000.png", b"not looked at"),
    ];
    let listed: Vec<_> = files
        .iter()
        .map(|it| json!({ "path": it.path, "bytes": it.bytes.len(), "sha256": it.sha256 }))
        .collect();
    let body = json!({ "subject": subject.name, "files": listed });
    let (status, upload) = send(address, "POST", "/v1/uploads", &body).await;
    assert_eq!(status, 200, "{upload}");
    let name = upload["name"].as_str().expect("a name").to_owned();
    let put = async |path: &str, range: &str, bytes: &str| {
        let range = match range {
            "" => String::new(),
            range => format!("Content-Range: bytes {range}\r\n"),
        };
        let path = format!("/v1/{name}/files/{path}");
        let (status, _, text) = ask_with(address, "PUT", &path, &range, bytes).await;
        (status, text)
    };
    let (status, text) = put("poses.json", "", "{}").await;
    assert!(
        status == 200 && text.contains("\"committed_bytes\":2"),
        "{text}"
    );
    let png = "frames%2F000000.png";
    assert_eq!(put(png, "0-3/13", "not ").await.0, 200);
    let (status, text) = put(png, "6-12/13", "ed at..").await;
    assert_eq!(status, 400, "{text}");
    assert!(text.contains("UPLOAD_OFFSET"), "{text}");
    let (status, text) = put(png, "4-7/13", "looked at").await;
    assert!(status == 400 && text.contains("another length"), "{text}");
    let (_, now) = get(address, &format!("/v1/{name}")).await;
    let committed = now["committed"].as_array().expect("files");
    let of_png = committed.iter().find(|it| it["path"] == files[1].path);
    assert_eq!(of_png.expect("is begun")["bytes"], 4);
    assert_eq!(put(png, "4-12/13", "looked at").await.0, 200);
    let (status, capture) = send(address, "POST", &format!("/v1/{name}:finish"), &json!({})).await;
    assert_eq!(
        (status, &capture["state"]),
        (200, &json!("INGESTING")),
        "{capture}"
    );
    let worker = service.worker(&["ingest"]).await;
    let lease = service.lease(&worker).await.expect("the ingest job waits");
    assert_eq!(service.ingested(&lease, &files[1].path), files[1].bytes);
}

#[tokio::test]
async fn a_file_comes_whole_or_in_ranges_and_never_as_a_page() {
    let stage = Stage::set().await;
    let (address, _serving) = listen(&stage.service).await;
    let page = b"<script>alert(1)</script>";
    let job = stage.export("ada.html", page).await;
    let (_, listed) = get(address, &format!("/v1/{job}/objects")).await;
    let name = listed["objects"][0]["name"].as_str().expect("a name");
    assert_eq!(listed["objects"][0]["bytes"], page.len());
    let path = format!("/v1/{name}:download");
    let (status, head, body) = ask_with(address, "GET", &path, "", "").await;
    assert_eq!((status, body.as_bytes()), (200, &page[..]));
    for header in [
        "content-disposition: attachment; filename=\"ada.html\"",
        "content-security-policy: sandbox; default-src 'none'",
        "x-content-type-options: nosniff",
        "accept-ranges: bytes",
        &format!("content-length: {}", page.len()),
    ] {
        assert!(head.contains(header), "{header} among {head}");
    }
    let etag = head.lines().find_map(|it| it.strip_prefix("etag: "));
    let etag = etag.expect("has one").trim().to_owned();
    let (status, head, body) = ask_with(address, "GET", &path, "Range: bytes=8-\r\n", "").await;
    assert_eq!((status, body.as_bytes()), (206, &page[8..]));
    let range = format!("content-range: bytes 8-{}/{}", page.len() - 1, page.len());
    assert!(head.contains(&range), "{head}");
    let known = format!("If-None-Match: {etag}\r\n");
    let (status, _, body) = ask_with(address, "GET", &path, &known, "").await;
    assert_eq!((status, body.as_str()), (304, ""));
    let (status, head, body) = ask_with(address, "HEAD", &path, "", "").await;
    assert_eq!((status, body.as_str()), (200, ""));
    assert!(
        head.contains(&format!("content-length: {}", page.len())),
        "{head}"
    );
    let (status, head, _) = ask_with(address, "GET", &path, "Range: bytes=99-\r\n", "").await;
    assert_eq!(status, 416);
    assert!(
        head.contains(&format!("content-range: bytes */{}", page.len())),
        "{head}"
    );
    let none = path.replace("ada.html", "bob.html");
    assert_eq!(ask_with(address, "GET", &none, "", "").await.0, 404);
}
