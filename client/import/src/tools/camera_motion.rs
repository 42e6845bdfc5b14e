//! The motion of the camera in the files of tools that find it.

use crate::ImportError;
use crate::geometry::{Vec3, exact_rotation, matvec, scale, transpose};
use crate::proof::{CameraPose, TrackedPerson, moves};
use crate::source::{Faulty, Part, is_number};

/// The notes about a world with gravity, and about one without.
pub(super) const Y_UP: &str = "the camera moves: bodies and cameras stand in the tool's world, whose y \
     points up";
pub(super) const FIRST_CAMERA: &str = "the camera moves: bodies and cameras stand in the axes of the \
     first frame's camera, for the file does not say where up is";

const NO_ROTATION: &str = "the camera's matrix is not a rotation";

/// A camera of each frame, or what is wrong with it.
pub(super) type Cameras = Vec<Result<CameraPose, &'static str>>;

/// The cameras of rotations `[F, 3, 3]` and positions `[F, 3]`, camera to world.
///
/// # Errors
/// When their numbers differ.
pub(super) fn of_cameras(
    rotations: &Part<'_>,
    positions: &Part<'_>,
) -> Result<Cameras, ImportError> {
    let matrices = rotations.unchecked_rows::<9>(None)?;
    let positions = positions.unchecked_rows::<3>(Some(matrices.len()))?;
    let camera = |(m, position): (&[f64; 9], Vec3)| {
        if !m.iter().chain(&position).copied().all(is_number) {
            return Err("the camera's rotation or position is not finite");
        }
        let matrix = [[m[0], m[1], m[2]], [m[3], m[4], m[5]], [m[6], m[7], m[8]]];
        let rotation = exact_rotation(&matrix).ok_or(NO_ROTATION)?;
        Ok(CameraPose { rotation, position })
    };
    Ok(matrices.iter().zip(positions).map(camera).collect())
}

/// The camera of a rotation and a translation, world to camera.
///
/// # Errors
/// When the matrix is not a rotation.
pub(super) fn of_extrinsics(
    rotation: &Part<'_>,
    shift: &Part<'_>,
) -> Result<CameraPose, ImportError> {
    let matrix = exact_rotation(&rotation.matrix()?);
    let matrix = matrix.ok_or_else(|| rotation.fault("NOT_A_ROTATION", NO_ROTATION))?;
    let back = transpose(&matrix);
    Ok(CameraPose {
        position: scale(matvec(&back, shift.fixed()?), -1.0),
        rotation: back,
    })
}

/// Gives every pose of `people` the camera of its frame, if the camera moves, and returns whether it
/// does. Poses whose frame has no sound camera are left out, with a note. Errors name `part`, which holds the
/// cameras.
///
/// # Errors
/// When many poses have none.
pub(super) fn follow(
    people: &mut [TrackedPerson],
    cameras: &Cameras,
    part: &Part<'_>,
    notes: &mut Vec<String>,
) -> Result<bool, ImportError> {
    let sound: Vec<CameraPose> = cameras.iter().flatten().copied().collect();
    if !sound.is_empty() && !moves(&sound) {
        return Ok(false);
    }
    let mut faulty = Faulty::default();
    for person in people {
        let mut kept = Vec::with_capacity(person.seen.len());
        for mut seen in std::mem::take(&mut person.seen) {
            let camera = match cameras.get(seen.number) {
                Some(camera) => camera.map_err(str::to_owned),
                None => Err(format!(
                    "there is no camera of frame {}, in which a person was seen: there are {}",
                    seen.number,
                    cameras.len()
                )),
            };
            let number = u32::try_from(seen.number).unwrap_or(u32::MAX);
            let of_frame = part.clone().of_frame(number);
            let camera = camera.map_err(|message| of_frame.fault("INVALID", message));
            seen.camera_pose = faulty.keep(camera)?;
            kept.extend(seen.camera_pose.is_some().then_some(seen));
        }
        person.seen = kept;
    }
    faulty.finish(notes)?;
    Ok(true)
}
