//! Files of jobs and captures, as pictures, films and pages in a browser.
//!
//! A worker has written them, so none of them may act as one of our pages: a browser shows only pictures in place, and gives
//! an exported page an origin of its own, in which it can neither call the service nor load anything.

use super::asker::Asker;
use super::fault::Fault;
use axum::body::Body;
use axum::extract::Path;
use axum::http::header::{
    CACHE_CONTROL, CONTENT_DISPOSITION, CONTENT_SECURITY_POLICY, CONTENT_TYPE,
};
use axum::http::{HeaderMap, HeaderValue};
use axum::response::{IntoResponse, Response};
use futures::StreamExt;
use tonic::Status;
use yoto_proto::keys::THUMBNAIL;
use yoto_proto::names;
use yoto_proto::v1::DownloadObjectRequest;
use yoto_proto::v1::object_service_server::ObjectService;

/// What a player may do in frames of these sites. It has its script and its data in itself. Without `allow-same-origin` its
/// origin is its own.
macro_rules! player {
    ($ancestors:literal) => {
        concat!(
            "sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline' 'wasm-unsafe-eval' blob:; \
             style-src 'unsafe-inline'; img-src data: blob:; connect-src data: blob:; worker-src blob:; \
             frame-ancestors ",
            $ancestors
        )
    };
}
/// The policy of a player in our own pages.
const PLAYER: &str = player!("'self'");
/// The policy of a player that is a page for itself.
pub const LONE_PLAYER: &str = player!("'none'");
/// The policy of a player that any site may show.
pub const EMBEDDED_PLAYER: &str = player!("*");
/// A picture that was replaced has another address.
const KEPT: &str = "private, max-age=86400, immutable";

/// How a browser treats a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Shows it, also in a page.
    Picture(&'static str),
    /// Runs it in an origin of its own.
    Player,
    /// Keeps it as a file.
    Other,
}

impl Kind {
    /// By the name of the file.
    pub fn of(file: &str) -> Self {
        let extension = file.rsplit_once('.').map_or("", |(_, it)| it);
        match extension {
            "png" => Self::Picture("image/png"),
            "jpg" | "jpeg" => Self::Picture("image/jpeg"),
            "webp" => Self::Picture("image/webp"),
            "gif" => Self::Picture("image/gif"),
            "html" => Self::Player,
            _ => Self::Other,
        }
    }
}

/// A file of a job.
pub async fn of_job(
    asker: Asker,
    Path((id, file)): Path<(String, String)>,
) -> Result<Response, Fault> {
    let name = names::object(&format!("jobs/{id}"), &file);
    answer(&asker, name, Kind::of(&file)).await
}

/// The person of a capture.
pub async fn thumbnail(asker: Asker, Path(id): Path<String>) -> Result<Response, Fault> {
    let name = names::object(&format!("captures/{id}"), THUMBNAIL);
    answer(&asker, name, Kind::of(THUMBNAIL)).await
}

/// The bytes of the object `name`; `None` if there are more than `most`.
///
/// # Errors
/// When there is no such object, or the service can't read it.
pub async fn whole(asker: &Asker, name: &str, most: usize) -> Result<Option<Vec<u8>>, Status> {
    let request = DownloadObjectRequest {
        name: name.to_owned(),
        ..DownloadObjectRequest::default()
    };
    let download = asker.objects().download_object(asker.request(request));
    let mut chunks = download.await?.into_inner();
    let mut bytes = Vec::new();
    while let Some(chunk) = chunks.next().await {
        bytes.extend(chunk?.chunk);
        if bytes.len() > most {
            return Ok(None);
        }
    }
    Ok(Some(bytes))
}

async fn answer(asker: &Asker, name: String, kind: Kind) -> Result<Response, Fault> {
    let request = DownloadObjectRequest {
        name,
        ..DownloadObjectRequest::default()
    };
    let chunks = asker.objects().download_object(asker.request(request));
    let chunks = chunks.await?.into_inner();
    let body = Body::from_stream(chunks.map(|chunk| chunk.map(|it| it.chunk)));
    let mut headers = HeaderMap::new();
    let mut set = |name, value| headers.insert(name, HeaderValue::from_static(value));
    set(CACHE_CONTROL, KEPT);
    match kind {
        Kind::Picture(content_type) => {
            set(CONTENT_TYPE, content_type);
            set(CONTENT_SECURITY_POLICY, "sandbox; default-src 'none'");
        }
        Kind::Player => {
            set(CONTENT_TYPE, "text/html; charset=utf-8");
            set(CONTENT_SECURITY_POLICY, PLAYER);
        }
        Kind::Other => {
            set(CONTENT_TYPE, "application/octet-stream");
            set(CONTENT_DISPOSITION, "attachment");
            set(CONTENT_SECURITY_POLICY, "sandbox; default-src 'none'");
        }
    }
    Ok((headers, body).into_response())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_known_pictures_are_shown_in_place() {
        assert_eq!(Kind::of("000001.png"), Kind::Picture("image/png"));
        assert_eq!(Kind::of("ada.html"), Kind::Player);
        for other in ["a.svg", "a.xhtml", "a.js", "png", "a.PNG.exe", ""] {
            assert_eq!(Kind::of(other), Kind::Other, "{other}");
        }
    }
}
