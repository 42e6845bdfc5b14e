//! Bytes of an uploaded file over HTTP: `PUT /v1/uploads/{id}/files/{path}`, with `Content-Range` for a part of it. A client
//! needs no library for checksums: TLS or loopback keep the bytes, and FinishUpload compares the SHA-256 of each file.

use super::call::{call, framed};
use super::{Calls, json, problem};
use axum::body::Body;
use axum::http::header::{CONTENT_LENGTH, CONTENT_RANGE};
use axum::http::request::Parts;
use axum::http::{HeaderMap, Method, Response};
use bytes::Bytes;
use futures::{Stream, StreamExt, stream};
use percent_encoding::percent_decode_str;
use prost::Message;
use tonic::Status;
use yoto_proto::crc32c;
use yoto_proto::limits::CHUNK_BYTES;
use yoto_proto::v1::WriteUploadRequest;
use yoto_request::RequestError;
use yoto_request::methods::POOL;

/// The call.
pub(super) const CALL: &str = "/yoto.v1.UploadService/WriteUpload";
const ANSWER: &str = "yoto.v1.WriteUploadResponse";

/// A file of an upload.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Target {
    upload: String,
    path: String,
}

/// The file whose bytes a request brings.
pub(super) fn target(verb: &Method, path: &str) -> Option<Target> {
    if verb != Method::PUT {
        return None;
    }
    let rest = path.strip_prefix("/v1/uploads/")?;
    let (id, file) = rest.split_once("/files/")?;
    let decoded = |text| percent_decode_str(text).decode_utf8().ok();
    let (id, path) = (decoded(id)?, decoded(file)?);
    (!id.is_empty() && !id.contains('/') && !path.is_empty()).then(|| Target {
        upload: format!("uploads/{id}"),
        path: path.into_owned(),
    })
}

/// Writes the body of the request to the file, and answers once all of it is durable.
pub(super) async fn answer(
    calls: &Calls,
    parts: &Parts,
    target: Target,
    body: Body,
) -> Response<Body> {
    match write(calls, parts, target, body).await {
        Ok(answer) => answer,
        Err(status) => problem::answer(&status),
    }
}

async fn write(
    calls: &Calls,
    parts: &Parts,
    target: Target,
    body: Body,
) -> Result<Response<Body>, Status> {
    let offset = offset(&parts.headers)?;
    let messages = Body::from_stream(messages(target, offset, body));
    let answers = call(calls.services.clone(), parts, CALL, messages).await?;
    let kind = POOL.get_message_by_name(ANSWER);
    let kind = kind.ok_or_else(|| Status::internal("the contract has no answer"))?;
    let message = json::read(kind, &answers.single().await?)?;
    Ok(super::answer(json::text(&message)?))
}

/// The file's bytes as messages of the call.
fn messages(
    target: Target,
    offset: u64,
    body: Body,
) -> impl Stream<Item = Result<Bytes, Status>> + Send {
    let chunks = body.into_data_stream().flat_map(|chunk| {
        let chunks = match chunk {
            Ok(mut whole) => {
                let mut chunks = Vec::new();
                while !whole.is_empty() {
                    chunks.push(Ok(whole.split_to(whole.len().min(CHUNK_BYTES))));
                }
                chunks
            }
            Err(error) => vec![Err(Status::cancelled(error.to_string()))],
        };
        stream::iter(chunks)
    });
    let state = (target, offset);
    chunks.scan(state, |(target, offset), chunk| {
        let message = chunk.and_then(|chunk| {
            let request = WriteUploadRequest {
                upload: target.upload.clone(),
                path: target.path.clone(),
                offset: *offset,
                crc32c: crc32c(&chunk),
                chunk,
            };
            *offset += request.chunk.len() as u64;
            framed(&request.encode_to_vec())
        });
        std::future::ready(Some(message))
    })
}

/// The offset of the first byte: that of `Content-Range: bytes FIRST-LAST/SIZE`, or 0.
fn offset(headers: &HeaderMap) -> Result<u64, RequestError> {
    let text = |name| headers.get(name).and_then(|it| it.to_str().ok());
    let Some(range) = headers.get(CONTENT_RANGE) else {
        return Ok(0);
    };
    let refused = |message: &str| Err(RequestError::invalid("Content-Range", message));
    let numbers = range.to_str().ok().and_then(|it| {
        let (range, _) = it.strip_prefix("bytes ")?.split_once('/')?;
        let (first, last) = range.split_once('-')?;
        Some((first.parse::<u64>().ok()?, last.parse::<u64>().ok()?))
    });
    let Some((first, last)) = numbers.filter(|(first, last)| first <= last) else {
        return refused("is not of the form `bytes FIRST-LAST/SIZE`");
    };
    let length = text(CONTENT_LENGTH).and_then(|it| it.parse::<u64>().ok());
    match length {
        Some(length) if length.checked_sub(1) != Some(last - first) => {
            refused("has another length than the body")
        }
        _ => Ok(first),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    #[test]
    fn a_path_names_an_upload_and_a_file() {
        let put = |path| target(&Method::PUT, path).map(|it| (it.upload, it.path));
        let found = put("/v1/uploads/7/files/frames/000000%2Epng");
        let expected = ("uploads/7".to_owned(), "frames/000000.png".to_owned());
        assert_eq!(found, Some(expected));
        for other in [
            "/v1/uploads/7",
            "/v1/uploads/7/files/",
            "/v1/uploads//files/a",
            "/v1/uploads/7/8/files/a",
            "/v1/jobs/7/files/a",
        ] {
            assert_eq!(put(other), None, "{other}");
        }
        assert_eq!(target(&Method::GET, "/v1/uploads/7/files/a"), None);
    }

    fn at(range: &'static str, length: &'static str) -> Option<u64> {
        let headers = [
            (CONTENT_RANGE, HeaderValue::from_static(range)),
            (CONTENT_LENGTH, HeaderValue::from_static(length)),
        ];
        offset(&headers.into_iter().collect()).ok()
    }

    #[test]
    fn a_range_says_where_the_bytes_begin() {
        assert_eq!(at("bytes 5-9/20", "5"), Some(5));
        assert_eq!(at("bytes 5-9/*", "5"), Some(5));
        assert_eq!(at("bytes 5-9/20", "4"), None, "another length");
        assert_eq!(at("bytes 9-5/20", "5"), None);
        assert_eq!(at("bytes=5-9", "5"), None);
        assert_eq!(offset(&HeaderMap::new()).ok(), Some(0));
    }

    #[tokio::test]
    async fn bytes_come_in_order_whatever_the_chunks() {
        let target = Target {
            upload: "uploads/7".to_owned(),
            path: "a".to_owned(),
        };
        let sent = vec![7_u8; CHUNK_BYTES + 3];
        let found = messages(target, 10, Body::from(sent));
        let found: Vec<_> = found.collect().await;
        let read = |bytes: &Result<Bytes, Status>| {
            let bytes = bytes.as_ref().expect("a message");
            WriteUploadRequest::decode(bytes.slice(5..)).expect("a request")
        };
        let requests: Vec<_> = found.iter().map(read).collect();
        let mut next = 10;
        for request in &requests {
            assert_eq!(request.offset, next);
            assert_eq!(request.crc32c, crc32c(&request.chunk));
            next += request.chunk.len() as u64;
        }
        assert_eq!(next, 10 + CHUNK_BYTES as u64 + 3);
    }
}
