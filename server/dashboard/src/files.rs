//! Files of jobs and captures, as pictures, films and pages in a browser.
//!
//! [`FileKind`] says what each may do.

use super::asker::Asker;
use super::page_error::PageError;
use axum::body::Body;
use axum::extract::Path;
use axum::http::header::{
    CACHE_CONTROL, CONTENT_DISPOSITION, CONTENT_SECURITY_POLICY, CONTENT_TYPE,
};
use axum::http::{HeaderMap, HeaderValue};
use axum::response::{IntoResponse, Response};
use futures::StreamExt;
use yoto_http::file_kind::{FileKind, PLAYER};
use yoto_proto::keys::THUMBNAIL;
use yoto_proto::names;
use yoto_proto::v1::DownloadObjectRequest;

/// A picture that was replaced has another address.
const KEPT: &str = "private, max-age=86400, immutable";

/// A file of a job.
pub(crate) async fn of_job(
    asker: Asker,
    Path((id, file)): Path<(String, String)>,
) -> Result<Response, PageError> {
    let name = names::object(&format!("jobs/{id}"), &file);
    answer(&asker, name, FileKind::of(&file)).await
}

/// The person of a capture.
pub(crate) async fn thumbnail(asker: Asker, Path(id): Path<String>) -> Result<Response, PageError> {
    let name = names::object(&format!("captures/{id}"), THUMBNAIL);
    answer(&asker, name, FileKind::of(THUMBNAIL)).await
}

async fn answer(asker: &Asker, name: String, kind: FileKind) -> Result<Response, PageError> {
    let request = DownloadObjectRequest {
        name,
        ..DownloadObjectRequest::default()
    };
    let chunks = asker
        .services()
        .objects
        .download_object(asker.request(request));
    let chunks = chunks.await?.into_inner();
    let body = Body::from_stream(chunks.map(|chunk| chunk.map(|it| it.chunk)));
    let mut headers = HeaderMap::new();
    let mut set = |name, value| headers.insert(name, HeaderValue::from_static(value));
    set(CACHE_CONTROL, KEPT);
    match kind {
        FileKind::Picture(content_type) => {
            set(CONTENT_TYPE, content_type);
            set(CONTENT_SECURITY_POLICY, "sandbox; default-src 'none'");
        }
        FileKind::Player => {
            set(CONTENT_TYPE, "text/html; charset=utf-8");
            set(CONTENT_SECURITY_POLICY, PLAYER);
        }
        FileKind::Other => {
            set(CONTENT_TYPE, "application/octet-stream");
            set(CONTENT_DISPOSITION, "attachment");
            set(CONTENT_SECURITY_POLICY, "sandbox; default-src 'none'");
        }
    }
    Ok((headers, body).into_response())
}
