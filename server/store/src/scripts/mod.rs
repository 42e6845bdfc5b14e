//! The transactions of the store, one file per noun: each function runs statements on a [`Tx`](super::db::Tx), which its
//! caller begins and commits. They are written once, for all databases.
//!
//! Functions for users take the tenant first, after the transaction. Those that have only ids run after one that has found
//! that the tenant has the resource.

pub mod aliases;
pub mod attempts;
pub mod audit;
pub mod capture_objects;
pub mod captures;
pub mod checkpoints;
pub mod consent_rule;
pub mod consents;
pub mod deletion;
pub mod ended;
pub mod erasures;
pub mod garbage;
#[cfg(test)]
mod guard_tests;
pub mod helpers;
pub mod inputs;
pub mod jobs;
pub mod keys;
pub mod leases;
pub mod leaving;
pub mod metrics;
pub mod models;
pub mod named;
pub mod object_store;
pub mod operators;
pub mod outcome;
pub mod outputs;
mod page;
pub mod pages;
pub mod pauses;
pub mod pins;
mod positions;
pub mod queue;
pub mod quotas;
pub mod ranges;
pub mod reaping;
pub mod removal;
pub mod requests;
pub mod retraining;
pub mod service_state;
#[cfg(test)]
mod shared_tests;
pub mod shares;
pub mod signed_parts;
mod slots;
pub mod steps;
pub mod subjects;
pub mod ticks;
pub mod traces;
pub mod upload_parts;
pub mod uploads;
pub mod usage;
pub mod versions;
pub mod webhooks;
pub mod workers;
