//! Compares a track with any joint hierarchy with masks, by its projected joints.

use super::choice::GOOD;
use super::score::FRAMES;
use super::silhouette::{LEAST, Silhouette, agreement_of};
use crate::ImportError;
use crate::clip::fault;
use crate::pictures::{Mask, read_masks};
use crate::track::Camera;
use std::collections::BTreeMap;
use std::path::Path;
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::Skeleton;
use yoto_proto::pose_track::PoseTrack;

/// The agreement of the bodies of `track` with the `masks` of their frames, 0 to 1; `None` where no frame
/// has both.
///
/// # Errors
/// When a mask can't be read; when the track is faulty.
pub(crate) fn agreement(
    track: &PoseTrack,
    masks: &BTreeMap<usize, Mask>,
    at: &Path,
) -> Result<Option<f64>, ImportError> {
    let wrong = |error: &dyn std::fmt::Display| fault(at, "INVALID", error.to_string());
    let skeleton = Skeleton::from_track(&track.skeleton).map_err(|error| wrong(&error))?;
    let mask = |index: u32| masks.get(&(index as usize));
    let frames = track.frames.iter().filter(|it| mask(it.index).is_some());
    let frames: Vec<_> = frames.collect();
    let (mut sum, mut count) = (0.0, 0.0);
    for frame in frames.iter().step_by(frames.len().div_ceil(FRAMES).max(1)) {
        let Some(mask) = mask(frame.index) else {
            continue;
        };
        let image = read_masks(std::slice::from_ref(mask), track.image_size, frame.index)?;
        let Some(silhouette) = Silhouette::new(image.as_raw(), track.image_size) else {
            continue;
        };
        let pose = Pose::from_frame(frame).map_err(|error| wrong(&error))?;
        let camera = Camera {
            k: frame.k,
            e: frame.e,
        };
        let joints = skeleton.posed_joints(&pose);
        let parents = skeleton.parents.iter().copied();
        sum += agreement_of(&joints, parents, &camera, &silhouette, track.image_size);
        count += 1.0;
    }
    Ok((count > 0.0).then_some(sum / count))
}

/// Notes the agreement of `track` with `masks`.
///
/// # Errors
/// When they disagree, and the errors of [`agreement`].
pub(crate) fn prove(
    track: &PoseTrack,
    masks: &BTreeMap<usize, Mask>,
    at: &Path,
    notes: &mut Vec<String>,
) -> Result<(), ImportError> {
    let Some(figure) = agreement(track, masks, at)? else {
        let message = "no frame has both a pose and a mask: are the masks of this clip?";
        return Err(fault(at, "MISSING", message));
    };
    let [percent, needed] = [figure, LEAST].map(|figure| 100.0 * figure);
    if figure < LEAST {
        let message = format!(
            "the poses do not agree with the masks: {percent:.0} %, {needed:.0} % are needed. Are poses and \
             masks of this clip and of the same person?"
        );
        return Err(fault(at, "UNPROVEN", message));
    }
    notes.push(said_agreement("the masks", figure));
    Ok(())
}

/// The agreement of a body with `masks`, in words.
pub(crate) fn said_agreement(masks: &str, figure: f64) -> String {
    let [percent, usual] = [figure, GOOD].map(|figure| 100.0 * figure);
    let poor = match figure < GOOD {
        true => format!(
            ". That is poor, {usual:.0} % and more are usual: are these masks and poses of the same frames?"
        ),
        false => String::new(),
    };
    format!("the body agrees with {masks} to {percent:.0} %{poor}")
}
