//! Checks of single request fields.

use crate::{error::RequestError, store::RequestKey};
use prost::Message;
use yoto_proto::names::Collection;

/// Longest display name, bytes.
const MAX_DISPLAY_NAME: usize = 200;
/// Longest consent note, bytes.
pub const MAX_CONSENT_NOTE: usize = 10_000;
/// Longest request id, bytes.
const MAX_REQUEST_ID: usize = 128;

/// The id in a resource name.
pub fn id(collection: Collection, field: &str, name: &str) -> Result<String, RequestError> {
    let id = collection.parse(name);
    id.map(str::to_owned)
        .map_err(|error| RequestError::invalid(field, error.to_string()))
}

/// A display name: one line, not empty, without the comma that separates names in lists.
pub fn display_name(name: &str) -> Result<String, RequestError> {
    let name = name.trim();
    if name.is_empty() || name.len() > MAX_DISPLAY_NAME || name.chars().any(char::is_control) {
        let message = format!("a display name is one line of 1 to {MAX_DISPLAY_NAME} bytes");
        return Err(RequestError::invalid("display_name", message));
    }
    if name.contains(',') {
        let message = format!("'{name}' has a comma, which separates names in lists");
        return Err(RequestError::invalid("display_name", message));
    }
    Ok(name.to_owned())
}

/// The key of a repeatable request.
pub fn request_key(
    method: &'static str,
    request_id: &str,
    body: &impl Message,
) -> Result<Option<RequestKey>, RequestError> {
    if request_id.len() > MAX_REQUEST_ID || request_id.chars().any(char::is_control) {
        let message = format!("a request id has at most {MAX_REQUEST_ID} printable bytes");
        return Err(RequestError::invalid("request_id", message));
    }
    Ok(RequestKey::new(method, request_id, body))
}
