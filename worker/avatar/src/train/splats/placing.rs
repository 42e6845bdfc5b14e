//! Where splats are placed: at the start of a training, and again while poses are refined. In a training that
//! refines poses, the first splats are few, on a hull of the given poses; each later hull is nearer to the truth,
//! as the poses are (docs/splats.md).

use crate::avatar::Avatar;
use crate::config::{ModelConfig, Variant};
use crate::train::TrainError;
use crate::train::model::Model;
use crate::train::people::{TrainFrame, TrainSubject};
use crate::train::poses::refinement::PoseRefinement;
use crate::train::run::Moment;
use crate::train::run::guard::TrainState;
use crate::train::splats::first::first_splats;
use tracing::trace_span;

/// How much a frame counts in training if the hull heeds it.
const TRUSTED: f64 = 0.5;

/// Places the splats of `subject` by the given poses, in a model after the completed fraction
/// `progress` of its first run. A person who is `known` keeps their splats, unless an earlier training
/// stopped before it placed all of them, and this one does not go on with it.
pub(crate) fn place_first(
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

/// Places the splats of the `subject` by the refined poses, if that is due. Returns a note for people if it is
/// done by the given ones.
pub(crate) fn place_again(
    model: &mut Model,
    subject: &TrainSubject,
    now: Moment,
) -> Result<Option<String>, TrainError> {
    let Some(config) = model.config.appearance.splats() else {
        return Ok(None);
    };
    let Some(poses) = &mut model.state.poses[subject.slot] else {
        return Ok(None);
    };
    let Some(count) = poses.places_again(config, now.opened, now.fraction) else {
        return Ok(None);
    };
    let _span = trace_span!("place splats").entered();
    let refined = |frame: &TrainFrame| {
        let trusted = poses.weight(frame.position) >= TRUSTED;
        trusted.then(|| poses.refined(frame.position, &frame.pose))
    };
    let mut note = None;
    let first = match first_splats(subject, refined, count) {
        Err(TrainError::People(why)) => {
            let by_given = format!("{why}; splats are placed by the given poses");
            tracing::warn!("{by_given}");
            note = Some(by_given);
            first_splats(subject, |frame| Some(frame.pose.clone()), count)?
        }
        first => first?,
    };
    let first = first.and_hidden(config.count);
    let own = Avatar::own_slot(&model.config, subject.slot);
    model.state.avatar_mut().place_splats(own, &first);
    Ok(note)
}
