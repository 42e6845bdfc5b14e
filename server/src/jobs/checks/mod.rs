//! Checks of orders and of results against the catalogue.
//!
//! What an order may say by itself is in `yoto_proto::checks`; here is what needs the catalogue and the
//! object store.

mod catalogue;
pub(super) mod results;
pub(super) mod specs;

use yoto_proto::names::Collection;
use yoto_request::RequestError;

/// The id in the resource `name` that the request has at `field`.
pub(super) fn parse<'a>(
    collection: Collection,
    field: &str,
    name: &'a str,
) -> Result<&'a str, RequestError> {
    collection
        .parse(name)
        .map_err(|error| RequestError::invalid(field, error.to_string()))
}
