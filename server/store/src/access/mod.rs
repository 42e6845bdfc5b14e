//! The methods of the [`Store`](super::Store), by what they are about.

mod audit;
mod catalogue;
mod consents;
mod erasures;
mod inspection;
mod jobs;
mod keys;
mod operators;
mod pages;
mod shares;
mod tenants;
mod upkeep;
mod uploads;
mod webhooks;
mod workers;
