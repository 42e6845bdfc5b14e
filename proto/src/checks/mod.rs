//! Checks of orders without the catalogue: the service runs them before it queues a job, a worker before it
//! begins, and a client may before it calls. Only the service checks an order against the catalogue.
//!
//! Every check returns all faults, with field paths relative to the order's own message.

pub mod evaluate;
pub mod export;
mod geometry;
pub mod render;
pub mod scene;
pub mod train;

use crate::v1::JobSpec;
use crate::v1::job_spec::Kind;
use prost::Message;
use std::fmt::Display;
use std::ops::RangeInclusive;

/// Longest encoded order, bytes: a job must fit into a message beside its result.
pub const SPEC_BYTES: usize = 8 << 20;

/// A fault of an order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SpecFault {
    /// Path of the field, e.g. `orbit.size`.
    pub field: String,
    /// What is wrong with it.
    pub message: String,
}

/// All faults of an order, with paths that begin with its kind, e.g. `train.seconds`. Files of a capture are
/// checked when they are uploaded.
pub fn job(spec: &JobSpec) -> Vec<SpecFault> {
    let mut found = SpecFaults::default();
    let bytes = spec.encoded_len();
    found.unless(bytes <= SPEC_BYTES, "", || {
        format!("{bytes} bytes; at most {SPEC_BYTES} are allowed, so split the job")
    });
    match &spec.kind {
        Some(Kind::Train(train)) => found.within_field("train", train::faults(train)),
        Some(Kind::Render(render)) => found.within_field("render", render::faults(render)),
        Some(Kind::Evaluate(evaluate)) => {
            found.within_field("evaluate", evaluate::faults(evaluate));
        }
        Some(Kind::Export(export)) => found.within_field("export", export::faults(export)),
        Some(Kind::Ingest(_)) => {}
        None => found.add("", "has no kind of job"),
    }
    found.0
}

/// The faults found so far.
#[derive(Debug, Default)]
struct SpecFaults(Vec<SpecFault>);

impl SpecFaults {
    fn add(&mut self, field: &str, message: impl Into<String>) {
        self.0.push(SpecFault {
            field: field.to_owned(),
            message: message.into(),
        });
    }

    fn unless(&mut self, good: bool, field: &str, message: impl FnOnce() -> String) {
        if !good {
            self.add(field, message());
        }
    }

    /// Checks that `value` is in `range`, and therefore not NaN.
    fn between<T: PartialOrd + Display>(
        &mut self,
        field: &str,
        value: T,
        range: &RangeInclusive<T>,
    ) {
        self.unless(range.contains(&value), field, || {
            let (least, most) = (range.start(), range.end());
            format!("{value} is not between {least} and {most}")
        });
    }

    /// The faults of the message in `field`.
    fn within_field(&mut self, field: &str, faults: Vec<SpecFault>) {
        self.0.extend(faults.into_iter().map(|fault| SpecFault {
            field: join(field, &fault.field),
            message: fault.message,
        }));
    }
}

/// The path of `inner`, a field of the message in `outer`.
fn join(outer: &str, inner: &str) -> String {
    match (outer, inner) {
        ("", only) | (only, "") => only.to_owned(),
        _ => format!("{outer}.{inner}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::v1::render_spec::What;
    use crate::v1::{RenderSpec, TrainSpec, View, ViewList};

    fn fields(spec: &JobSpec) -> Vec<String> {
        job(spec).into_iter().map(|fault| fault.field).collect()
    }

    #[test]
    fn a_path_begins_with_the_kind_of_job() {
        let train = TrainSpec {
            seconds: -1.0,
            image_size: 7,
            ..TrainSpec::default()
        };
        let spec = JobSpec {
            kind: Some(Kind::Train(train)),
        };
        assert_eq!(fields(&spec), ["train.seconds", "train.image_size"]);
        assert_eq!(fields(&JobSpec { kind: None }), [""]);
    }

    #[test]
    fn an_order_fits_into_a_message() {
        let views = vec![View::default(); SPEC_BYTES / 2 + 1];
        let render = RenderSpec {
            what: Some(What::Views(ViewList { views })),
            ..RenderSpec::default()
        };
        let spec = JobSpec {
            kind: Some(Kind::Render(render)),
        };
        let found = job(&spec);
        assert!(found[0].message.ends_with("so split the job"), "{found:?}");
    }
}
