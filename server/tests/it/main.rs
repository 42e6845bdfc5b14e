//! The coordinator as its clients and workers see it.

mod captures;
mod catalogue;
mod changes;
mod clock;
mod deletions;
mod evaluations;
mod exports;
mod faults;
mod faulty_fields;
mod garbage;
mod helpers;
mod leases;
mod metrics;
mod queue;
mod results;
mod retention;
mod retries;
mod scenes;
mod service;
mod status;
mod support;
mod tradeoffs;
mod traffic;
mod uploads;
mod watch_all;
mod watching;
