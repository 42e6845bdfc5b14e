//! Messages as JSON, in the form of the command line's `--json`: fields by their names in the contract, with those that have
//! their default.

use super::problem;
use prost::{Message, Name};
use prost_reflect::{DynamicMessage, MessageDescriptor, SerializeOptions};
use serde_json::Value;
use tonic::Status;
use yoto_request::methods::POOL;

/// The message of the type `kind` in `bytes`.
///
/// # Errors
/// When it is none, which is a fault of the service.
pub(super) fn read(kind: MessageDescriptor, bytes: &[u8]) -> Result<DynamicMessage, Status> {
    DynamicMessage::decode(kind, bytes)
        .map_err(|error| Status::internal(format!("an answer can't be read: {error}")))
}

/// A message in one line.
///
/// # Errors
/// When it has no form in JSON, as a time beyond the calendar, which is a fault of the service.
pub(super) fn text(message: &DynamicMessage) -> Result<String, Status> {
    let value = value(message)
        .map_err(|error| Status::internal(format!("an answer has no form in JSON: {error}")))?;
    Ok(value.to_string())
}

/// A message of the contract as its call tells it over HTTP; `None` if the contract has no such message.
pub fn of<M: Message + Name>(message: &M) -> Option<Value> {
    let mut dynamic = DynamicMessage::new(POOL.get_message_by_name(&M::full_name())?);
    dynamic.transcode_from(message).ok()?;
    value(&dynamic).ok()
}

fn value(message: &DynamicMessage) -> Result<Value, serde_json::Error> {
    let options = SerializeOptions::new()
        .use_proto_field_name(true)
        .stringify_64_bit_integers(false)
        .skip_default_fields(false);
    message.serialize_with_options(serde_json::value::Serializer, &options)
}

/// An error in one line, as [`problem`] tells it.
pub(super) fn error(status: &Status) -> String {
    problem::told(status).to_string()
}
