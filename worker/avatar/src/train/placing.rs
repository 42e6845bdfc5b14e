//! Where splats are placed: at the start of a training, and again while poses are refined. Then the first
//! are few, on a hull of given poses; each time, poses are nearer to the truth, and so is the hull
//! (docs/splats.md).

use super::first_splats::first_splats;
use super::frame_order::FrameIndex;
use super::guard::TrainState;
use super::people::{TrainFrame, TrainSubject};
use super::refinement::PoseRefinement;
use super::{TrainError, Trainer};
use crate::avatar::Avatar;
use crate::config::{ModelConfig, Variant};
use tracing::trace_span;

/// How much a frame counts in training if the hull heeds it.
const TRUSTED: f64 = 0.5;

/// Places the splats of `subject` by the given poses, in a model after the completed fraction
/// `progress` of its first run. Those of somebody `known` stay, unless a training that would have placed
/// more of them was not ended and nobody ends it.
pub(super) fn place_first(
    state: &mut TrainState,
    config: &ModelConfig,
    progress: f64,
    subject: &TrainSubject,
    known: bool,
) -> Result<(), TrainError> {
    let Some(splats) = config.appearance.splats() else {
        return Ok(());
    };
    let own = Avatar::own_slot(config, subject.slot);
    let placing = match config.variant {
        Variant::NoIdentity => state.poses.iter().flatten().any(PoseRefinement::has_placed),
        _ => state.poses[subject.slot]
            .as_ref()
            .is_some_and(PoseRefinement::has_placed),
    };
    if known && (placing || state.avatar().shows_all_splats(own)?) {
        return Ok(());
    }
    let count = match &mut state.poses[subject.slot] {
        Some(poses) => poses.places_first(splats, progress, 0.0),
        None => splats.count,
    };
    let first = first_splats(subject, |frame| Some(frame.pose.clone()), count)?;
    state
        .avatar_mut()
        .place_splats(own, &first.and_hidden(splats.count));
    Ok(())
}

impl Trainer {
    /// Places the splats of the person at `place` by the refined poses, if that is due.
    pub(super) fn place_again(&mut self, place: FrameIndex) -> Result<(), TrainError> {
        let (opened, fraction) = (self.opened(), self.fraction());
        let subject = &self.subjects[place.subject];
        let Some(config) = self.config.appearance.splats() else {
            return Ok(());
        };
        let Some(poses) = &mut self.state.poses[subject.slot] else {
            return Ok(());
        };
        let Some(count) = poses.places_again(config, opened, fraction) else {
            return Ok(());
        };
        let _span = trace_span!("place splats").entered();
        let refined = |frame: &TrainFrame| {
            let trusted = poses.weight(frame.place) >= TRUSTED;
            trusted.then(|| poses.refined(frame.place, &frame.pose))
        };
        let first = match first_splats(subject, refined, count) {
            Err(TrainError::People(why)) => {
                let note = format!("{why}; splats are placed by the given poses");
                tracing::warn!("{note}");
                self.progress.notes.push(note);
                first_splats(subject, |frame| Some(frame.pose.clone()), count)?
            }
            first => first?,
        };
        let first = first.and_hidden(config.count);
        let own = Avatar::own_slot(&self.config, subject.slot);
        self.state.avatar_mut().place_splats(own, &first);
        Ok(())
    }
}
