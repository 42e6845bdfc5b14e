//! The motions of an order: of captures, whose tracks are fetched, and of clips.

use super::of_motion;
use crate::jobs::checkpoint::Downloaded;
use crate::jobs::{JobContext, JobFailure, shard};
use std::collections::HashMap;
use yoto_export::source::Source;
use yoto_proto::exports::moves_as_captured;
use yoto_proto::v1::export_motion::Motion;
use yoto_proto::v1::{ExportMotion, ExportSpec};
use yoto_proto::worker::v1::Inputs;

/// Name of a clip that has none.
const NAME: &str = "motion";

/// The motions of an order.
pub(super) struct Motions<'a> {
    context: &'a JobContext,
    spec: &'a ExportSpec,
    inputs: &'a Inputs,
    found: &'a Downloaded,
    /// Those of captures that were fetched, by subject.
    captured: HashMap<String, Source>,
}

impl<'a> Motions<'a> {
    /// Those of `spec`, with the poses that the training of the checkpoint `found` refined.
    pub(super) fn new(
        context: &'a JobContext,
        spec: &'a ExportSpec,
        inputs: &'a Inputs,
        found: &'a Downloaded,
    ) -> Self {
        Self {
            context,
            spec,
            inputs,
            found,
            captured: HashMap::new(),
        }
    }

    /// All that the files have, in the order's order.
    pub(super) fn all(mut self) -> Result<Vec<Source>, JobFailure> {
        let spec = self.spec;
        if moves_as_captured(spec) {
            return Ok(vec![self.of_capture(&spec.subject)?]);
        }
        spec.motions.iter().map(|it| self.one(it)).collect()
    }

    fn one(&mut self, motion: &ExportMotion) -> Result<Source, JobFailure> {
        let source = match &motion.motion {
            Some(Motion::Capture(part)) => {
                let driver = match &*part.driver {
                    "" => &self.spec.subject,
                    driver => driver,
                };
                let whole = self.of_capture(driver)?;
                whole.part(part)
            }
            Some(Motion::Clip(clip)) => {
                let name = match &*motion.name {
                    "" => NAME,
                    name => name,
                };
                return Source::clip(name, clip, &motion.up).map_err(|error| of_motion(&error));
            }
            None => {
                return Err(JobFailure::invalid(
                    "export",
                    "motions",
                    "one has no motion",
                ));
            }
        };
        let source = source.map_err(|error| of_motion(&error))?;
        Ok(match &*motion.name {
            "" => source,
            name => source.called(name),
        })
    }

    /// The motion of the capture of `subject`, under their name.
    fn of_capture(&mut self, subject: &str) -> Result<Source, JobFailure> {
        if let Some(known) = self.captured.get(subject) {
            return Ok(known.clone());
        }
        let (name, shard) =
            shard::with_refined_poses(self.context, self.inputs, self.found, subject)?;
        let source = Source::track(&name, &shard.track).map_err(|error| of_motion(&error))?;
        self.captured.insert(subject.to_owned(), source.clone());
        Ok(source)
    }
}
