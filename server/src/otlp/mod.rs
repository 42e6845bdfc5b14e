//! Figures and traces for a collector of OpenTelemetry, sent by OTLP over gRPC.
//!
//! Behind a balancer a scrape reaches any one of several coordinators; what a coordinator sends has its own instance id. The
//! figures are those of `/metrics`, from the same registries (`figures`). A job that ends at this coordinator becomes a trace
//! (`spans`), whose ids follow from the job's name, so that coordinators that send the same job send the same spans. Nothing
//! waits for the collector: jobs wait in a bounded queue ([`crate::notify::EndedJobs`]), and what does not fit is counted and dropped.

mod attributes;
mod figures;
mod push;
mod spans;
mod wire;

pub(crate) use push::run;
pub(crate) use wire::Wire;
