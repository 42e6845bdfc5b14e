//! Checks of single request fields.

use crate::{error::RequestError, store::RequestKey};
use prost::Message;
use yoto_proto::{
    limits::{DISPLAY_NAME_BYTES, REQUEST_ID_BYTES},
    names::Collection,
};

/// The id in a resource name.
pub fn id(collection: Collection, field: &str, name: &str) -> Result<String, RequestError> {
    let id = collection.parse(name);
    id.map(str::to_owned)
        .map_err(|error| RequestError::invalid(field, error.to_string()))
}

/// A display name: one line, not empty, without the comma that separates names in lists.
pub fn display_name(name: &str) -> Result<String, RequestError> {
    let name = name.trim();
    if name.is_empty() || name.len() > DISPLAY_NAME_BYTES || name.chars().any(char::is_control) {
        let message = format!("a display name is one line of 1 to {DISPLAY_NAME_BYTES} bytes");
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
    if request_id.len() > REQUEST_ID_BYTES || request_id.chars().any(char::is_control) {
        let message = format!("a request id has at most {REQUEST_ID_BYTES} printable bytes");
        return Err(RequestError::invalid("request_id", message));
    }
    Ok(RequestKey::new(method, request_id, body))
}
