//! Parsing that the files of several tools share.

use crate::ImportError;
use crate::geometry::{Vec3, log_map};
use crate::proof::{PoseEstimate, TrackedPerson};
use crate::source::Part;
use crate::track::SmplPose;
use std::sync::Arc;
use yoto_formats::rle::RunLengths;

/// Adds a frame to the person `name`.
pub(super) fn push(people: &mut Vec<TrackedPerson>, name: String, seen: PoseEstimate) {
    match people.iter_mut().find(|person| person.name == name) {
        Some(person) => person.seen.push(seen),
        None => people.push(TrackedPerson {
            name,
            seen: vec![seen],
        }),
    }
}

/// Run lengths, or a list of one; `None` where there are none.
pub(super) fn runs(part: &Part<'_>) -> Result<Option<Arc<RunLengths>>, ImportError> {
    if part.is_list() {
        return match part.len()? {
            0 => Ok(None),
            _ => runs(&part.at(0)?),
        };
    }
    if part.find("counts").is_none() {
        return Ok(None);
    }
    let mask = RunLengths::read(part.value());
    mask.map(|mask| Some(Arc::new(mask)))
        .map_err(|error| part.fault("UNDECODABLE", error.to_string()))
}

/// A pose from 24 rotation matrices of 9 numbers each, rows first.
pub(super) fn pose_of_matrices(matrices: &[f64]) -> SmplPose {
    let mut pose = [0.0; 72];
    let (matrices, _) = matrices.as_chunks::<9>();
    let (axes, _) = pose.as_chunks_mut::<3>();
    for (axis, m) in axes.iter_mut().zip(matrices) {
        *axis = match m.iter().find(|value| !value.is_finite()) {
            Some(value) => [*value; 3],
            None => log_map(&[[m[0], m[1], m[2]], [m[3], m[4], m[5]], [m[6], m[7], m[8]]]),
        };
    }
    pose
}

/// A pose from the root's rotation and those of SMPL-X's 21 joints; hands as the wrists.
pub(super) fn pose_of_smplx(root: Vec3, body: &[f64; 63]) -> SmplPose {
    let mut pose = [0.0; 72];
    pose[..3].copy_from_slice(&root);
    pose[3..66].copy_from_slice(body);
    pose
}
