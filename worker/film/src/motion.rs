//! The motion of one person on the body of another, seen by the driver's own camera.

use crate::error::PlanError;
use crate::follow::followed;
use crate::shot::Shot;
use crate::track::{capture_camera, find_position, pose, skeleton};
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::timing::{self, mean_fps};
use yoto_capture::skeleton::{Skeleton, Vec3, transfer};
use yoto_proto::frame_steps::chosen_below;
use yoto_proto::pose_track::PoseTrack;
use yoto_proto::v1::MotionTransfer;

/// Positions of frames in the driver's `track`: every `frame_step`-th frame (0 means 1) from `first_frame` on,
/// `frame_count` of them (0 means all remaining ones), or those before the `end_frame`. The request has the motion
/// at `field`.
pub(crate) fn positions(
    transfer: &MotionTransfer,
    track: &PoseTrack,
    field: &str,
) -> Result<Vec<usize>, PlanError> {
    let first = match transfer.first_frame {
        Some(index) => find_position(track, index, &format!("{field}.first_frame"))?,
        None => 0,
    };
    let (step, count, end) = (
        transfer.frame_step,
        transfer.frame_count,
        transfer.end_frame,
    );
    let numbers = track.frames.iter().map(|frame| frame.index);
    chosen_below(numbers, first, step, count, end).map_err(|left| {
        let first = track.frames.get(first).map_or(0, |frame| frame.index);
        let (name, message) = match end {
            Some(end) => (
                "end_frame",
                format!("the driver's capture has no frame below {end} from frame {first} on"),
            ),
            None => (
                "frame_count",
                format!(
                    "{count} frames, but the driver's capture has {left} from frame {first} on in steps of {}",
                    step.max(1)
                ),
            ),
        };
        PlanError::invalid(&format!("{field}.{name}"), message)
    })
}

/// Frames per second at which the frames at the `positions` of the driver's `track` move as fast as the
/// driver did; `None` for a single frame.
pub(crate) fn natural_fps(positions: &[usize], track: &PoseTrack) -> Option<f32> {
    mean_fps(&seconds(positions, track)).map(|fps| fps as f32)
}

/// Seconds from the first of the frames at the `positions` of `track` to each of them.
pub(crate) fn seconds(positions: &[usize], track: &PoseTrack) -> Vec<f64> {
    let numbers = positions
        .iter()
        .map(|position| track.frames[*position].index);
    timing::seconds(&numbers.collect::<Vec<_>>(), track.fps)
}

/// The poses at the `positions` of the driver's `track` on `body`. The capture's world has `up` up.
pub(crate) fn poses(
    driver: &Skeleton,
    body: &Skeleton,
    track: &PoseTrack,
    positions: &[usize],
    up: Vec3,
) -> Result<Vec<Pose>, PlanError> {
    let driven = positions
        .iter()
        .map(|position| pose(&track.frames[*position]));
    let driven = driven.collect::<Result<Vec<_>, _>>()?;
    transfer(driver, body, &driven, &seconds(positions, track), up).map_err(|(index, error)| {
        let frame = format!(
            "the driver's frame {}",
            track.frames[positions[index]].index
        );
        PlanError::failed("RETARGET", &frame, &error)
    })
}

/// The shots of `transfer`: `body` in the driver's poses at the `positions` of their `track`.
pub(crate) fn shots(
    transfer: &MotionTransfer,
    positions: &[usize],
    track: &PoseTrack,
    body: &Skeleton,
) -> Result<Vec<Shot>, PlanError> {
    let driver = skeleton(track, "the driver")?;
    let cameras = positions.iter().map(|position| {
        let camera = capture_camera(track, &track.frames[*position])?;
        Ok(sized(&camera, transfer.size))
    });
    let cameras = cameras.collect::<Result<Vec<_>, PlanError>>()?;
    let Some(first) = cameras.first() else {
        return Ok(Vec::new());
    };
    let poses = poses(&driver, body, track, positions, first.world_up())?;
    let shots = poses.iter().zip(&cameras).map(|(pose, camera)| Shot {
        pose: pose.clone(),
        camera: match transfer.follow {
            true => followed(first, &poses[0], pose),
            false => camera.clone(),
        },
    });
    Ok(shots.collect())
}

/// `camera` with `size` pixels on its longest side, which may exceed the capture's.
pub(crate) fn sized(camera: &Camera, size: u32) -> Camera {
    let zoom = f64::from(size) / f64::from(camera.width.max(camera.height));
    let side = |pixels: u32| ((f64::from(pixels) * zoom).round() as u32).max(1);
    camera.resized(side(camera.width), side(camera.height))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::track;

    fn transfer(first_frame: u32, frame_count: u32, frame_step: u32) -> MotionTransfer {
        MotionTransfer {
            driver: "subjects/b".into(),
            first_frame: Some(first_frame),
            frame_count,
            frame_step,
            size: 32,
            ..MotionTransfer::default()
        }
    }

    fn body() -> Skeleton {
        Skeleton::from_track(&track().skeleton).expect("a skeleton")
    }

    fn all_shots(transfer: &MotionTransfer) -> Result<Vec<Shot>, PlanError> {
        let track = track();
        let positions = positions(transfer, &track, "motion")?;
        shots(transfer, &positions, &track, &body())
    }

    #[test]
    fn the_driver_s_poses_and_cameras_come_in_order() {
        let track = track();
        let views = all_shots(&transfer(6, 2, 2)).expect("views");
        assert_eq!(views.len(), 2);
        for (view, frame) in views.iter().zip([&track.frames[1], &track.frames[3]]) {
            assert_eq!(view.pose.rotations, pose(frame).expect("a pose").rotations);
            assert_eq!((view.camera.width, view.camera.height), (32, 24));
            assert!((view.camera.k[0][0] - frame.k[0][0] / 2.0).abs() < 1e-9);
            assert_eq!(view.camera.e, frame.e);
        }
    }

    #[test]
    fn nothing_said_means_every_frame_that_is_left() {
        let all = all_shots(&transfer(5, 0, 0)).expect("views");
        assert_eq!(all.len(), track().frames.len());
    }

    #[test]
    fn an_end_is_a_frame_s_number() {
        let mut track = track();
        for (frame, index) in track.frames.iter_mut().zip([60, 62, 64, 66]) {
            frame.index = index;
        }
        let until = |end| {
            let transfer = MotionTransfer {
                end_frame: Some(end),
                ..transfer(60, 9, 1)
            };
            positions(&transfer, &track, "motion")
        };
        assert_eq!(until(64).expect("two frames"), [0, 1]);
        assert_eq!(until(120).expect("all that there are"), [0, 1, 2, 3]);
        let Err(PlanError::Invalid(violations)) = until(60) else {
            panic!("refused");
        };
        assert_eq!(violations[0].field, "motion.end_frame");
    }

    #[test]
    fn skipped_frames_do_not_hurry_the_motion() {
        let mut track = track();
        assert_eq!(natural_fps(&[0, 1, 2, 3], &track), Some(15.0));
        assert_eq!(natural_fps(&[0, 2], &track), Some(7.5));
        assert_eq!(natural_fps(&[1], &track), None);
        // A capture that took every third frame of its video.
        for (frame, index) in track.frames.iter_mut().zip([0, 3, 6, 9]) {
            frame.index = index;
        }
        assert_eq!(natural_fps(&[0, 1, 2, 3], &track), Some(5.0));
    }

    #[test]
    fn skipped_frames_take_their_time() {
        assert_eq!(seconds(&[1, 3], &track()), [0.0, 2.0 / 15.0]);
    }

    #[test]
    fn more_than_the_capture_has_is_refused() {
        for (asked, field) in [
            (transfer(6, 4, 1), "motion.frame_count"),
            (transfer(0, 1, 1), "motion.first_frame"),
        ] {
            let Err(PlanError::Invalid(violations)) = all_shots(&asked) else {
                panic!("refused");
            };
            assert_eq!(violations[0].field, field);
        }
    }
}
