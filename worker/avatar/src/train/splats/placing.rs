//! The placement of splats, and their growth in number. A training that refines poses widely starts with few, since many small
//! ones learn the mean of wrong poses by heart; once poses are better, they are split until there are all
//! (docs/research/splats.md).

use crate::config::{Appearance, ModelConfig, Variant};
use crate::train::TrainError;
use crate::train::model::Model;
use crate::train::people::TrainSubject;
use crate::train::poses::refinement::PoseRefinement;
use crate::train::run::Moment;
use crate::train::run::guard::TrainState;
use crate::train::splats::error::errors;
use crate::train::splats::first::initial_splats;
use crate::train::splats::split::split;
use tracing::trace_span;
use yoto_capture::skeleton::smpl::has_joints;

/// Places the splats of `subject` by the given poses, in a model after the completed fraction
/// `progress` of its first run. A person who is `known` keeps their splats, unless an earlier training
/// stopped before it placed all of them, and this one does not go on with it. Returns a note if the shared body does not
/// have the person's skeleton, or if the person seems to wear a skirt.
pub(crate) fn place_initial_splats(
    state: &mut TrainState,
    config: &ModelConfig,
    progress: f64,
    subject: &TrainSubject,
    known: bool,
) -> Result<Option<String>, TrainError> {
    let splats = match &config.appearance {
        Appearance::Splats(splats) => splats,
        // A field starts everywhere.
        Appearance::Field(_) => return Ok(None),
    };
    let own = subject.own_slot;
    let placing = match config.variant {
        Variant::NoIdentity => state.poses.iter().flatten().any(PoseRefinement::has_placed),
        _ => state.poses[subject.slot]
            .as_ref()
            .is_some_and(PoseRefinement::has_placed),
    };
    if known && (placing || state.avatar().shows_all_splats(own)?) {
        return Ok(None);
    }
    let count = match &mut state.poses[subject.slot] {
        Some(poses) => poses.initial_splat_count(splats, progress, 0.0),
        None => splats.count,
    };
    let first = initial_splats(subject, splats, |frame| Some(frame.pose.clone()), count)?;
    let name = &subject.name;
    let strange = splats.surface && !has_joints(&subject.body.skeleton);
    let note = match (strange, first.in_skirt) {
        (true, _) => Some(format!(
            "{name}: the skeleton does not have the 24 joints of SMPL, so splats start on what the masks enclose, not on the \
             shared body"
        )),
        (false, true) => Some(format!(
            "{name}: something closes the gap between the legs in the frames that show them apart, so it moves with both legs, as a \
             skirt or a coat does"
        )),
        (false, false) => None,
    };
    state
        .avatar_mut()
        .place_splats(own, &first.values.padded_to(splats.count));
    Ok(note)
}

/// Splits the splats of the `subject` where the error is until there are as many as are due. The halves know
/// what the whole has learned, so that a picture hardly changes.
pub(crate) fn split_splats(
    model: &mut Model,
    subject: &TrainSubject,
    now: Moment,
) -> Result<(), TrainError> {
    let config = match &model.config.appearance {
        Appearance::Splats(splats) => splats,
        Appearance::Field(_) => return Ok(()),
    };
    let Some(poses) = &mut model.state.poses[subject.slot] else {
        return Ok(());
    };
    let Some(count) = poses.due_splat_count(config, now.schedule_progress, now.fraction) else {
        return Ok(());
    };
    let _span = trace_span!("grow").entered();
    let worth = errors(model, subject, now)?;
    let own = subject.own_slot;
    let avatar = model.state.avatar_mut();
    let mut splats = avatar.splat_values(own)?;
    let from = split(&mut splats, &worth, count);
    avatar.replace_splats(own, &splats, &from)?;
    Ok(())
}
