//! A client with a service of its own in one folder, from captures to pictures: what the demo and
//! `yoto avatar` have in common. All of it goes through the API, as any client's work does.
//!
//! ```text
//! folder (may it be replaced?) → service (runs while the work lasts) → person (upload, ingest)
//!                                → training → shots (render jobs and their files)
//!                                           → players (export jobs: pages that play)
//!                                           → trained (a checkpoint's files)
//! ```

pub(crate) mod folder;
pub(crate) mod person;
pub(crate) mod players;
pub(crate) mod service;
pub(crate) mod shots;
pub(crate) mod trained;
pub(crate) mod training;
