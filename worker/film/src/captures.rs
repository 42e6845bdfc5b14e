//! The captures that a plan reads, fetched before.

use crate::error::PlanError;
use std::collections::BTreeMap;
use std::sync::Arc;
use yoto_capture::Shard;
use yoto_proto::pose_track::PoseTrack;

/// A fetched capture.
#[derive(Debug)]
pub enum Capture {
    /// Poses and cameras alone.
    Track(PoseTrack),
    /// With its pictures.
    Shard(Arc<Shard>),
}

/// The captures of a render, by model and subject: each with the poses that its model was taught.
#[derive(Debug, Default)]
pub struct Captures(BTreeMap<(String, String), Capture>);

impl Captures {
    /// Adds the capture of `subject`, as the `model` knows it.
    pub fn insert(&mut self, model: &str, subject: &str, capture: Capture) {
        self.0.insert((model.into(), subject.into()), capture);
    }

    fn get(&self, model: &str, subject: &str) -> Result<&Capture, PlanError> {
        let capture = self.0.get(&(model.to_owned(), subject.to_owned()));
        capture
            .ok_or_else(|| PlanError::internal(format!("the capture of {subject} was not fetched")))
    }

    /// Poses and cameras of `subject`.
    pub(crate) fn track(&self, model: &str, subject: &str) -> Result<&PoseTrack, PlanError> {
        Ok(match self.get(model, subject)? {
            Capture::Track(track) => track,
            Capture::Shard(shard) => &shard.track,
        })
    }

    /// The pictures of `subject`, unless only their track was needed.
    pub(crate) fn shard(
        &self,
        model: &str,
        subject: &str,
    ) -> Result<Option<&Arc<Shard>>, PlanError> {
        Ok(match self.get(model, subject)? {
            Capture::Track(_) => None,
            Capture::Shard(shard) => Some(shard),
        })
    }
}
