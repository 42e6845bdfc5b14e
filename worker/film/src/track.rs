//! Frames of a capture's track: their positions, poses and cameras.

use crate::error::PlanError;
use yoto_capture::ViewError;
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::Skeleton;
use yoto_proto::pose_track::{Frame, PoseTrack};

/// The position in `track` of the frame with the `index`, which the request has at `field`.
pub(crate) fn find_position(
    track: &PoseTrack,
    index: u32,
    field: &str,
) -> Result<usize, PlanError> {
    track
        .frames
        .iter()
        .position(|frame| frame.index == index)
        .ok_or_else(|| {
            let count = track.frames.len();
            PlanError::invalid(
                field,
                format!("none of the capture's {count} frames has the index {index}"),
            )
        })
}

/// The frame of `track` with the `index`, which the request has at `field`.
pub(crate) fn find_frame<'a>(
    track: &'a PoseTrack,
    index: u32,
    field: &str,
) -> Result<&'a Frame, PlanError> {
    Ok(&track.frames[find_position(track, index, field)?])
}

/// The pose of a captured frame.
pub(crate) fn pose(frame: &Frame) -> Result<Pose, PlanError> {
    Pose::from_frame(frame).map_err(|error| captured(frame, &error))
}

/// The camera of a captured frame.
pub(crate) fn capture_camera(track: &PoseTrack, frame: &Frame) -> Result<Camera, PlanError> {
    Camera::from_frame(frame, track.image_size).map_err(|error| captured(frame, &error))
}

/// Ingested captures were checked, so this is not a fault of the user.
fn captured(frame: &Frame, error: &ViewError) -> PlanError {
    PlanError::failed(
        "INTERNAL",
        &format!("the capture's frame {}", frame.index),
        error,
    )
}

/// The skeleton of `track`; `owner` says of what, as in "the driver's skeleton".
pub(crate) fn skeleton(track: &PoseTrack, owner: &str) -> Result<Skeleton, PlanError> {
    Skeleton::from_track(&track.skeleton)
        .map_err(|error| PlanError::failed("INTERNAL", &format!("{owner}'s skeleton"), &error))
}
