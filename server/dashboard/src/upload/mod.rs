//! A person is added on the page of people, by name and files, and a further capture on the page of the person.
//!
//! ```text
//! form ─► assets/upload.js: checks, checksums ─► calls: token ─► the calls of /v1 ─► the page of the person
//! ```

mod calls;
mod form;

pub(crate) use calls::{begin, cancel, cancel_capture, finish, person, state, write};
pub(crate) use form::{Whose, form, limits};
