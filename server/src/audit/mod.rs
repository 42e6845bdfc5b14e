//! The audit log: who has called what that changes something, and how it ended. An entry is written before the call begins and
//! another after it has ended. Where the end is missing, the coordinator ended during the call, or within 0.1 s after it. Each
//! entry has the hash of the one before it ([`yoto_store::audit_chain`]): one that was changed, or taken out of the middle, is found.
//!
//! ```text
//! AccessLayer ─► layer: a call that changes something ─► task: BEGUN ─► the call ─► task: ENDED
//! ```

mod budget;
mod layer;
mod names;
mod task;
mod writer;

pub(crate) use budget::{of_key, of_tenant};
pub(crate) use layer::record;
pub(crate) use task::run;
pub(crate) use writer::Audit;
