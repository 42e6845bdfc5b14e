//! A person is added on the page of people: name, files, and the way to the person's page.
//!
//! ```text
//! form ─► assets/upload.js: checks, checksums ─► calls: token ─► the calls of /v1 ─► the page of the person
//! ```

mod calls;
mod form;

pub use calls::{begin, cancel, finish, person, state, write};
pub use form::form;
