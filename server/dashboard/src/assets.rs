//! The files of all pages. They are in the program, and their names contain their digests: a browser keeps them, and
//! never mixes those of two versions.

use super::page_error::PageError;
use axum::extract::Path;
use axum::http::header::{ACCESS_CONTROL_ALLOW_ORIGIN, CACHE_CONTROL, CONTENT_TYPE};
use axum::http::{HeaderName, StatusCode};
use axum::response::{IntoResponse, Response};
use std::sync::LazyLock;
use yoto_proto::sha256_hex;

/// A file in the program.
#[derive(Debug)]
pub(crate) struct Asset {
    /// Where it is served.
    pub path: String,
    content_type: &'static str,
    content: &'static str,
}

impl Asset {
    fn new(name: &str, content_type: &'static str, content: &'static str) -> Self {
        let digest = sha256_hex(content.as_bytes());
        Self {
            path: format!("/assets/{}-{name}", &digest[..12]),
            content_type,
            content,
        }
    }

    /// What it is.
    pub(crate) fn content_type(&self) -> &'static str {
        self.content_type
    }

    /// The text of the file.
    pub(crate) fn content(&self) -> &'static str {
        self.content
    }
}

/// The style sheet.
pub(crate) static STYLE: LazyLock<Asset> = LazyLock::new(|| {
    let text = include_str!("assets/page.css");
    Asset::new("page.css", "text/css; charset=utf-8", text)
});
/// The script.
pub(crate) static SCRIPT: LazyLock<Asset> = LazyLock::new(|| {
    let text = include_str!("assets/page.js");
    Asset::new("page.js", "text/javascript; charset=utf-8", text)
});
/// The script that sends a person's files.
pub(crate) static UPLOAD: LazyLock<Asset> = LazyLock::new(|| {
    // One module: what these say is seen by those behind them.
    let text = concat!(
        include_str!("assets/upload/sha256.js"),
        include_str!("assets/upload/capture.js"),
        include_str!("assets/upload/pack.js"),
        include_str!("assets/upload/upload.js"),
    );
    Asset::new("upload.js", "text/javascript; charset=utf-8", text)
});
/// The icon.
pub(crate) static ICON: LazyLock<Asset> = LazyLock::new(|| {
    let text = include_str!("assets/icon.svg");
    Asset::new("icon.svg", "image/svg+xml", text)
});
/// What the pages of this program are made with: a page of another program loads itself anew.
pub(crate) static BUILD: LazyLock<String> = LazyLock::new(|| {
    let version = env!("CARGO_PKG_VERSION");
    let all = format!("{version}{}{}{}", STYLE.path, SCRIPT.path, UPLOAD.path);
    sha256_hex(all.as_bytes())[..12].to_owned()
});

/// The name of the script of `<yoto-avatar>`. It stays the same, since pages of other sites name it.
const ELEMENT: &str = "yoto-avatar.js";

/// The script of `<yoto-avatar>`, which pages of other sites may load.
fn element() -> Response {
    let headers = [
        (CONTENT_TYPE, "text/javascript; charset=utf-8"),
        (CACHE_CONTROL, "public, max-age=3600"),
        (ACCESS_CONTROL_ALLOW_ORIGIN, "*"),
        (
            HeaderName::from_static("cross-origin-resource-policy"),
            "cross-origin",
        ),
    ];
    (headers, yoto_player::ELEMENT.as_str()).into_response()
}

/// An asset.
pub(crate) async fn file(Path(name): Path<String>) -> Result<Response, PageError> {
    if name == ELEMENT {
        return Ok(element());
    }
    let path = format!("/assets/{name}");
    let found = [&*STYLE, &*SCRIPT, &*UPLOAD, &*ICON]
        .into_iter()
        .find(|it| it.path == path);
    let Some(asset) = found else {
        let words = "this file is of another version of the service: reload the page";
        return Err(PageError::of(StatusCode::NOT_FOUND, words));
    };
    let headers = [
        (CONTENT_TYPE, asset.content_type),
        (CACHE_CONTROL, "public, max-age=31536000, immutable"),
    ];
    Ok((headers, asset.content).into_response())
}
