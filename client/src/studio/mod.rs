//! A client with a service of its own in one folder, from captures to pictures: what the demo and
//! `yoto avatar` have in common. All of it goes through the API, as any client's work does.
//!
//! ```text
//! folder (may it be replaced?) → service (runs while the work lasts) → person (upload, ingest)
//!                                → training → shots (render jobs and their files)
//!                                           → trained (a checkpoint's files, pages that play)
//! ```

pub mod folder;
pub mod person;
pub mod service;
pub mod shots;
pub(crate) mod trained;
pub mod training;
