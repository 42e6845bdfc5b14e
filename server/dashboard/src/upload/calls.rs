//! The requests of the script that sends files. Each is a call of the API over HTTP, made as the page's reader.
//!
//! The calls themselves take no password of a browser, since it sends one with whatever asks for it, and they can do everything:
//! make keys, and erase people. So the script has these paths instead. They need the token of the page in a header, and they
//! lead to the calls of an upload alone; the deletions among them are only of a person without a capture, and of an open upload.

use super::super::asker::Asker;
use super::super::page_error::PageError;
use super::super::token;
use axum::body::{Body, to_bytes};
use axum::extract::{Path, Request};
use axum::http::{Method, StatusCode, Uri};
use axum::response::Response;
use serde::Deserialize;
use url::form_urlencoded::byte_serialize;
use yoto_proto::limits::LONGEST_PAGE_ENTRIES;
use yoto_proto::v1::{GetCaptureRequest, ListSubjectsRequest, Subject, capture, subject};

/// Longest description of a person, bytes.
const LONGEST: usize = 64 << 10;

/// Makes the call at `path`, of which the parts of others are names already.
async fn call(
    asker: &Asker,
    request: Request,
    verb: Method,
    path: &str,
) -> Result<Response, PageError> {
    let (mut parts, body) = request.into_parts();
    let path = Uri::try_from(path);
    parts.uri = path.map_err(|_| PageError::of(StatusCode::BAD_REQUEST, "this is no address"))?;
    parts.method = verb;
    Ok(asker.call(Request::from_parts(parts, body)).await)
}

/// Deletes the resource `name`, unless its version has another `etag` by now.
async fn delete(
    asker: &Asker,
    request: Request,
    name: &str,
    etag: &str,
) -> Result<Response, PageError> {
    let etag: String = byte_serialize(etag.as_bytes()).collect();
    let path = format!("/v1/{name}?etag={etag}");
    call(asker, request, Method::DELETE, &path).await
}

/// Lets a request of our own pages pass.
fn checked(asker: &Asker, request: &Request) -> Result<(), PageError> {
    token::checked_of_script(&asker.token()?, request.headers())
}

/// Whether `id` can be an id, and nothing else of a path.
fn named(id: &str) -> Result<&str, PageError> {
    let known = |it: u8| it.is_ascii_alphanumeric() || it == b'-';
    match !id.is_empty() && id.bytes().all(known) {
        true => Ok(id),
        false => Err(PageError::of(
            StatusCode::NOT_FOUND,
            "there is no such upload",
        )),
    }
}

/// What a person is called.
#[derive(Deserialize)]
struct Called {
    #[serde(default)]
    display_name: String,
}

/// `POST /people/upload/person`: CreateSubject, if nobody with files is called so. A request that is repeated finds the person that
/// it has made, who has none.
pub(crate) async fn person(asker: Asker, request: Request) -> Result<Response, PageError> {
    checked(&asker, &request)?;
    let (parts, body) = request.into_parts();
    let refused = |words| PageError::of(StatusCode::BAD_REQUEST, words);
    let body = to_bytes(body, LONGEST).await;
    let body = body.map_err(|_| refused("the form is too long, or broke off"))?;
    let called: Called =
        serde_json::from_slice(&body).map_err(|_| refused("the form is no JSON"))?;
    if is_taken(&asker, called.display_name.trim()).await? {
        let words = "there is a person of this name already: choose another one";
        return Err(PageError::of(StatusCode::CONFLICT, words));
    }
    let request = Request::from_parts(parts, Body::from(body));
    call(&asker, request, Method::POST, "/v1/subjects").await
}

/// Whether somebody of this name has a capture.
async fn is_taken(asker: &Asker, name: &str) -> Result<bool, PageError> {
    let mut page_token = String::new();
    loop {
        let request = ListSubjectsRequest {
            page_size: LONGEST_PAGE_ENTRIES as i32,
            page_token,
        };
        let list = asker
            .services()
            .subjects
            .list_subjects(asker.request(request));
        let list = list.await?.into_inner();
        let same = |it: &Subject| it.display_name == name && it.state() != subject::State::Erased;
        let mut found = list.subjects.iter().filter(|it| same(it));
        if found.any(|it| !it.captures.is_empty()) {
            return Ok(true);
        }
        page_token = list.next_page_token;
        if page_token.is_empty() {
            return Ok(false);
        }
    }
}

/// `POST /people/upload/files`: CreateUpload
pub(crate) async fn begin(asker: Asker, request: Request) -> Result<Response, PageError> {
    checked(&asker, &request)?;
    call(&asker, request, Method::POST, "/v1/uploads").await
}

/// `GET /people/upload/files/{id}`: GetUpload, with its query
pub(crate) async fn state(
    asker: Asker,
    Path(id): Path<String>,
    request: Request,
) -> Result<Response, PageError> {
    checked(&asker, &request)?;
    let query = request.uri().query().unwrap_or_default();
    let path = format!("/v1/uploads/{}?{query}", named(&id)?);
    call(&asker, request, Method::GET, &path).await
}

/// `PUT /people/upload/files/{id}/{file}`: WriteUpload, with `Content-Range`. The slashes of the file are encoded.
pub(crate) async fn write(
    asker: Asker,
    Path((id, file)): Path<(String, String)>,
    request: Request,
) -> Result<Response, PageError> {
    checked(&asker, &request)?;
    let file: String = byte_serialize(file.as_bytes()).collect();
    let path = format!("/v1/uploads/{}/files/{file}", named(&id)?);
    call(&asker, request, Method::PUT, &path).await
}

/// `POST /people/upload/finish/{id}`: FinishUpload
pub(crate) async fn finish(
    asker: Asker,
    Path(id): Path<String>,
    request: Request,
) -> Result<Response, PageError> {
    checked(&asker, &request)?;
    let path = format!("/v1/uploads/{}:finish", named(&id)?);
    call(&asker, request, Method::POST, &path).await
}

/// `POST /people/upload/cancel/{id}`: DeleteSubject of a person whose only upload is open, with all that was sent of it. Everybody
/// else is deleted by the command alone.
pub(crate) async fn cancel(
    asker: Asker,
    Path(id): Path<String>,
    request: Request,
) -> Result<Response, PageError> {
    checked(&asker, &request)?;
    let subject = asker.subject(&format!("subjects/{}", named(&id)?)).await?;
    if subject.state() != subject::State::Uploading || subject.captures.len() > 1 {
        let words =
            "the person has a capture by now: `yoto subject delete` deletes them with all captures";
        return Err(PageError::of(StatusCode::CONFLICT, words));
    }
    // If the capture is finished meanwhile, it is another version of the person.
    delete(&asker, request, &subject.name, &subject.etag).await
}

/// `POST /people/upload/cancel-capture/{id}`: DeleteCapture of an open upload, with all that was sent of it.
pub(crate) async fn cancel_capture(
    asker: Asker,
    Path(id): Path<String>,
    request: Request,
) -> Result<Response, PageError> {
    checked(&asker, &request)?;
    let get = GetCaptureRequest {
        name: format!("captures/{}", named(&id)?),
    };
    let capture = asker.services().subjects.get_capture(asker.request(get));
    let capture = capture.await?.into_inner();
    if capture.state() != capture::State::Uploading {
        let words = "the capture is uploaded by now: `yoto subject delete-capture` deletes it";
        return Err(PageError::of(StatusCode::CONFLICT, words));
    }
    // If the upload is finished meanwhile, it is another version of the capture.
    delete(&asker, request, &capture.name, &capture.etag).await
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_id_is_nothing_else_of_a_path() {
        let id = "8d0e6f5c-0000-4000-8000-000000000000";
        assert!(named(id).is_ok_and(|it| it == id));
        for other in ["", "a:finish", "..", "a/b", "a?b", "a%2Fb", "\u{e4}"] {
            assert!(named(other).is_err(), "{other}");
        }
    }
}
