//! The detector's own skeleton, in place of a body with SMPL's joints that is fitted to its points.

use super::detections::{Detection, Detections, OwnPose};
use super::mhr::TO_CAMERA;
use crate::clip::fault;
use crate::geometry::{IDENTITY_ROTATION, extrinsics, matmul, sub};
use crate::hierarchy::{GlobalPose, JointHierarchy, Measured, measure};
use crate::track::{Camera, empty_track};
use crate::{ImportError, Options};
use std::path::Path;
use yoto_proto::pose_track::{Frame, PoseTrack};

/// Largest median distance of joints from where bones of constant length put them, metres. The tool's
/// positions follow from its rotations; the sizes that it finds differ a little from frame to frame.
const SCATTER: f64 = 0.01;

/// The track of a person who is `seen`, in pictures of `size`, in the axes of the camera.
///
/// # Errors
/// When the detector has no skeleton, or its rotations and positions do not belong together.
pub(super) fn track(
    found: &Detections,
    seen: &[(usize, &Detection)],
    size: [u32; 2],
    fps: f64,
    options: &Options,
    at: &Path,
    notes: &mut Vec<String>,
) -> Result<PoseTrack, ImportError> {
    let Some(hierarchy) = &found.hierarchy else {
        let message = format!(
            "{} writes points, which have no tree of joints to keep: without --keep-skeleton a body with \
             SMPL's joints is fitted to them",
            found.name
        );
        return Err(fault(at, "UNREAD_OPTION", message));
    };
    if options.height.is_some() {
        let message = "a skeleton that is kept has its own size: --height needs another import, without \
                       --keep-skeleton";
        return Err(fault(at, "UNREAD_OPTION", message));
    }
    if options.point_rotation.is_some() || options.mirror_points {
        let message = "a skeleton that is kept can't be turned or mirrored: --turn-points and --mirror-points need an import without \
                       --keep-skeleton";
        return Err(fault(at, "UNREAD_OPTION", message));
    }
    let own = |(frame, detection): &(usize, &Detection)| {
        let own = detection.own.clone();
        own.map(|own| (*frame, own)).ok_or_else(|| {
            let message = format!(
                "frame {frame} has no rotations (pred_global_rots), which a skeleton that is kept needs: \
                 without --keep-skeleton a body is fitted to the joints"
            );
            fault(at, "MISSING", message)
        })
    };
    let mut poses: Vec<(usize, OwnPose)> = seen.iter().map(own).collect::<Result<_, _>>()?;
    let measured = read(hierarchy, &mut poses, at, notes)?;
    let standing = hierarchy.retarget(&measured.standing);
    let mut track = empty_track(standing.skeleton(1.0), size, fps);
    let rest = standing.rest.first().copied().unwrap_or_default();
    track.frames = poses
        .iter()
        .map(|(index, own)| {
            let mut root = own.placed.positions.first().copied().unwrap_or_default();
            let focal = options.focal.unwrap_or(own.focal);
            // The body stays where it is seen.
            root[2] *= focal / own.focal;
            let [x, y] = size.map(|side| 0.5 * f64::from(side));
            let k = [[focal, 0.0, x], [0.0, focal, y], [0.0, 0.0, 1.0]];
            let camera = Camera::from_centres(k, extrinsics(&IDENTITY_ROTATION, [0.0; 3]));
            Frame {
                index: *index as u32,
                pose: standing.local_rotations(&own.placed.rotations).concat(),
                translation: sub(root, rest),
                k: camera.k,
                e: camera.e,
            }
        })
        .collect();
    Ok(track)
}

/// The skeleton that the `poses` share, with the axes of rotations in which bones keep their length;
/// `poses` are left in these axes.
fn read(
    hierarchy: &JointHierarchy,
    poses: &mut [(usize, OwnPose)],
    at: &Path,
    notes: &mut Vec<String>,
) -> Result<Measured, ImportError> {
    let placed = |poses: &[(usize, OwnPose)]| -> Option<Measured> {
        let placed: Vec<&GlobalPose> = poses.iter().map(|(_, own)| &own.placed).collect();
        measure(hierarchy, &placed)
    };
    let given = placed(poses);
    rotate_to_camera(poses);
    let turned = placed(poses);
    let (Some(given), Some(turned)) = (given, turned) else {
        let message = "hips and neck are at one point, so that the up direction is unknown";
        return Err(fault(at, "INVALID", message));
    };
    let is_turned = turned.scatter < 0.5 * given.scatter;
    let best = if is_turned { turned } else { given };
    if !is_turned {
        rotate_to_camera(poses);
    }
    if best.scatter > SCATTER {
        let message = format!(
            "rotations and positions of its joints do not belong together: bones of constant length miss half \
             of the joints by {:.0} mm and more",
            1e3 * best.scatter
        );
        return Err(fault(at, "UNPROVEN", message));
    }
    if is_turned {
        notes.push(
            "the rotations are in the camera's axes already, unlike those that the tool's own code writes"
                .to_owned(),
        );
    }
    notes.push(format!(
        "the skeleton is the tool's own: {} joints; bones of constant length put them {:.0} mm (median) from \
         where the file has them. Fingers, toes, face and helpers are merged into the joints above \
         (docs/use/pose-tools.md)",
        hierarchy.0.len(),
        1e3 * best.scatter
    ));
    Ok(best)
}

/// Rotates all rotations to the camera's axes, or back.
fn rotate_to_camera(poses: &mut [(usize, OwnPose)]) {
    let rotations = poses
        .iter_mut()
        .flat_map(|(_, own)| &mut own.placed.rotations);
    rotations.for_each(|it| *it = matmul(&TO_CAMERA, it));
}
