//! The transactions of the store, one file per noun: each function runs statements on a [`Tx`](super::db::Tx), which its
//! caller begins and commits. They are written once, for all databases.
//!
//! Functions for users take the tenant first, after the transaction. Those that have only ids run after one that has found
//! that the tenant has the resource.

pub(crate) mod aliases;
pub(crate) mod attempts;
pub(crate) mod audit;
pub(crate) mod capture_objects;
pub(crate) mod captures;
pub(crate) mod checkpoints;
pub(crate) mod consent_rule;
#[cfg(test)]
mod consent_rule_tests;
pub(crate) mod consents;
pub(crate) mod deletion;
pub(crate) mod ended;
pub(crate) mod erasures;
pub(crate) mod garbage;
#[cfg(test)]
mod guard_tests;
pub(crate) mod helpers;
pub(crate) mod inputs;
pub(crate) mod jobs;
pub(crate) mod keys;
pub(crate) mod leases;
pub(crate) mod leaving;
pub(crate) mod metrics;
pub(crate) mod models;
pub(crate) mod named;
pub(crate) mod object_store;
pub(crate) mod operators;
pub(crate) mod outcome;
pub(crate) mod outputs;
mod page;
pub(crate) mod pages;
pub(crate) mod pauses;
pub(crate) mod pins;
mod positions;
pub(crate) mod queue;
pub(crate) mod quotas;
pub(crate) mod ranges;
pub(crate) mod reaping;
pub(crate) mod removal;
pub(crate) mod requests;
pub(crate) mod retraining;
pub(crate) mod service_state;
#[cfg(test)]
mod shared_tests;
pub(crate) mod shares;
pub(crate) mod signed_parts;
mod slots;
pub(crate) mod steps;
pub(crate) mod subjects;
pub(crate) mod ticks;
pub(crate) mod traces;
pub(crate) mod upload_parts;
pub(crate) mod uploads;
pub(crate) mod usage;
pub(crate) mod versions;
pub(crate) mod webhooks;
pub(crate) mod workers;
