//! Motions of captures: pose tracks. Their world is anyone's, such as the camera's, whose y points down: which axis is
//! up is found from the motion, and compared with how the cameras are held.

use super::up::{self, Up, Usual};
use super::{Motion, MotionFrame, MotionOptions, posture};
use crate::ImportError;
use crate::geometry::{add, log_map, matmul, matvec, rodrigues};
use crate::source::Source;
use yoto_capture::camera::Camera;
use yoto_capture::skeleton::{Pose, Skeleton, timing};
use yoto_proto::pose_track::PoseTrack;
use yoto_proto::smpl;

/// The motion of the track `name`, with poses at equal times.
pub(super) fn read(
    source: &Source,
    name: &str,
    options: &MotionOptions,
) -> Result<Motion, ImportError> {
    let bytes = source.bytes(name, None)?;
    let mut track = PoseTrack::from_file(name, &bytes).map_err(|found| source.bad(found))?;
    let mut notes: Vec<String> = smpl::unify(&mut track).into_iter().collect();
    let poses = track.frames.iter().map(|frame| {
        Pose::from_frame(frame).map_err(|error| {
            source.fault(
                "INVALID",
                name,
                Some(frame.index),
                &error.field,
                &error.message,
            )
        })
    });
    let poses = poses.collect::<Result<Vec<_>, _>>()?;
    let up = match options.up {
        Some(up) => up,
        None => {
            let (up, note) = found_up(&track, &poses)
                .map_err(|message| source.fault("NOT_STANDING", name, None, "frames", message))?;
            notes.push(note);
            up
        }
    };
    let upright = up.to_y();
    let numbers: Vec<u32> = track.frames.iter().map(|frame| frame.index).collect();
    let (poses, fps) = timing::even(poses, &numbers, track.fps);
    let rest = track.skeleton.rest_joints.first().copied();
    let rest = rest.unwrap_or_default();
    let frame = |pose: &Pose| {
        let mut rotations = pose.rotations_f64();
        if let Some(root) = rotations.first_mut() {
            // The rest pose has y up in every world.
            *root = log_map(&matmul(&upright, &rodrigues(*root)));
        }
        MotionFrame {
            rotations,
            root: matvec(&upright, add(rest, pose.translation.map(f64::from))),
        }
    };
    let names = track.skeleton.names.iter();
    Ok(Motion {
        frames: poses.iter().map(frame).collect(),
        fps,
        matched: names.map(|name| (name.clone(), name.clone())).collect(),
        unmatched: Vec::new(),
        notes,
        skeleton: track.skeleton,
    })
}

/// The axis that is up, and a note about it.
fn found_up(track: &PoseTrack, poses: &[Pose]) -> Result<(Up, String), String> {
    let cameras = track.frames.first().and_then(|first| {
        let camera = Camera::from_frame(first, track.image_size).ok()?;
        Up::of_vector(camera.world_up())
    });
    let skeleton = Skeleton::from_track(&track.skeleton).map_err(|error| error.to_string())?;
    let postures = posture::of_poses(&skeleton, poses);
    match (postures, cameras) {
        (Some(postures), cameras) => {
            let usual = cameras.map(|up| Usual {
                up,
                who: "the capture's first camera",
                is_documented: false,
            });
            up::find(&postures, usual)
        }
        // Joints of other names show neither a head nor feet.
        (None, Some(up)) => Ok((
            up,
            format!("{up} is taken to be up, as the capture's first camera has it (--up)"),
        )),
        (None, None) => Err(format!(
            "no joint is called as a head or a foot of SMPL's, which would tell the axis that is up: give it (--up {})",
            up::ALL.map(|up| up.to_string()).join(", ")
        )),
    }
}
