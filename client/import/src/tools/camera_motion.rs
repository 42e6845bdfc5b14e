//! The motion of the camera in the files of tools that find it.

use crate::geometry::{Mat3, exact_rotation, matvec, scale, transpose};
use crate::proof::{CameraPose, Person, moves};
use crate::source::Part;
use yoto_client::ClientError;

/// The notes about a world with gravity, and about one without.
pub(super) const Y_UP: &str = "the camera moves: bodies and cameras stand in the tool's world, whose y \
     points up";
pub(super) const FIRST_CAMERA: &str = "the camera moves: bodies and cameras stand in the axes of the \
     first frame's camera, for the file does not say where up is";

/// The cameras of rotations `[F, 3, 3]` and positions `[F, 3]`, camera to world.
///
/// # Errors
/// When their numbers differ, or a matrix is not a rotation.
pub(super) fn of_cameras(
    rotations: &Part<'_>,
    positions: &Part<'_>,
) -> Result<Vec<CameraPose>, ClientError> {
    let matrices = rotations.flat_rows::<9>()?;
    let positions = positions.same_rows::<3>(matrices.len())?;
    let both = matrices.iter().zip(positions).enumerate();
    both.map(|(frame, (m, shift))| {
        let rotation = [[m[0], m[1], m[2]], [m[3], m[4], m[5]], [m[6], m[7], m[8]]];
        Ok(CameraPose {
            rotation: rotation_of(rotation, &rotations.clone().of_frame(frame as u32))?,
            position: shift,
        })
    })
    .collect()
}

/// The camera of a rotation and a translation, world to camera.
///
/// # Errors
/// When the matrix is not a rotation.
pub(super) fn of_extrinsics(
    rotation: &Part<'_>,
    shift: &Part<'_>,
) -> Result<CameraPose, ClientError> {
    let back = transpose(&rotation_of(rotation.matrix()?, rotation)?);
    Ok(CameraPose {
        position: scale(matvec(&back, shift.fixed()?), -1.0),
        rotation: back,
    })
}

/// `matrix`, if it is a rotation. Errors name `part`, which holds it.
fn rotation_of(matrix: Mat3, part: &Part<'_>) -> Result<Mat3, ClientError> {
    exact_rotation(&matrix)
        .ok_or_else(|| part.fault("NOT_A_ROTATION", "the camera's matrix is no rotation"))
}

/// Gives every pose of `people` the camera of its frame, if the camera moves, and returns whether it
/// does. Errors name `part`, which holds the cameras.
///
/// # Errors
/// When a pose's frame has no camera.
pub(super) fn follow(
    people: &mut [Person],
    cameras: &[CameraPose],
    part: &Part<'_>,
) -> Result<bool, ClientError> {
    if !moves(cameras) {
        return Ok(false);
    }
    for seen in people.iter_mut().flat_map(|person| &mut person.seen) {
        let camera = cameras.get(seen.number).ok_or_else(|| {
            let message = format!(
                "there is no camera of frame {}, in which a person was seen: there are {}",
                seen.number,
                cameras.len()
            );
            part.fault("MISSING", message)
        })?;
        seen.camera_pose = Some(*camera);
    }
    Ok(true)
}
