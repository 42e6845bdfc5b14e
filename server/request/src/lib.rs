//! A request: who makes it, what is wrong with it, and the status that answers it.
//!
//! ```text
//! call ─► tenant_of, Caller: who asks ─► validation: all faults of the fields at once ─► RequestError ─► status
//! ```

mod caller;
mod error;
pub mod methods;
mod status;
pub mod validation;

pub use caller::{Caller, tenant_of, trace_parent_of};
pub use error::RequestError;
