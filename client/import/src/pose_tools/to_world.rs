//! The motion of a tool's camera: from each frame's camera axes to a world that all frames share.
//!
//! Readings and their proof are of the camera's axes, in which the tools find bodies. Where the camera
//! moves, the body that was read is then moved to the world together with its camera, so that it
//! projects to the same pixels.

use super::tool::Person;
use crate::geometry::{
    Mat3, Vec3, add, apply, axis_angle, exact_rotation, extrinsics, mul, rotation, scale, transpose,
};
use crate::source::Part;
use crate::track::{Camera, Placed};
use yoto_client::ClientError;

/// Least turn (of an entry of the matrix) and shift, metres, of a camera that moves.
const MOVED: [f64; 2] = [1e-4, 1e-3];

/// What is said of a world with gravity, and of one without.
pub(super) const Y_UP: &str = "the camera moves: bodies and cameras stand in the tool's world, whose y \
     points up";
pub(super) const FIRST_CAMERA: &str = "the camera moves: bodies and cameras stand in the axes of the \
     first frame's camera, for the file does not say where up is";

/// A camera's place in the world: a point x in its axes is at `turn x + shift`, metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ToWorld {
    turn: Mat3,
    shift: Vec3,
}

impl ToWorld {
    /// Of rotations `[F, 3, 3]` and positions `[F, 3]`, camera to world.
    ///
    /// # Errors
    /// When there are not as many of both, or a matrix is no rotation.
    pub fn of_cameras(turns: &Part<'_>, shifts: &Part<'_>) -> Result<Vec<Self>, ClientError> {
        let matrices = turns.flat_rows::<9>()?;
        let shifts = shifts.same_rows::<3>(matrices.len())?;
        let both = matrices.iter().zip(shifts).enumerate();
        both.map(|(frame, (m, shift))| {
            let turn = [[m[0], m[1], m[2]], [m[3], m[4], m[5]], [m[6], m[7], m[8]]];
            Ok(Self {
                turn: rotation_of(turn, &turns.clone().of_frame(frame as u32))?,
                shift,
            })
        })
        .collect()
    }

    /// Of a rotation and a translation, world to camera.
    ///
    /// # Errors
    /// When the matrix is no rotation.
    pub fn of_extrinsics(turn: &Part<'_>, shift: &Part<'_>) -> Result<Self, ClientError> {
        let back = transpose(&rotation_of(turn.matrix()?, turn)?);
        Ok(Self {
            shift: scale(apply(&back, shift.fixed()?), -1.0),
            turn: back,
        })
    }

    /// A body in the camera's axes, and its camera, in the world.
    pub fn place(&self, camera: Camera, placed: Placed) -> (Camera, Placed) {
        let mut pose = placed.pose;
        let root = rotation([pose[0], pose[1], pose[2]]);
        pose[..3].copy_from_slice(&axis_angle(&mul(&self.turn, &root)));
        let placed = Placed {
            pose,
            root: add(apply(&self.turn, placed.root), self.shift),
        };
        let back = transpose(&self.turn);
        let e = extrinsics(&back, scale(apply(&back, self.shift), -1.0));
        (Camera { e, ..camera }, placed)
    }

    fn is_at(&self, other: &Self) -> bool {
        let far =
            |a: &[f64], b: &[f64], most: f64| a.iter().zip(b).any(|(a, b)| (a - b).abs() > most);
        let [turned, shifted] = MOVED;
        !far(self.turn.as_flattened(), other.turn.as_flattened(), turned)
            && !far(&self.shift, &other.shift, shifted)
    }
}

/// `matrix`, if it is a rotation; `part` is where it is from.
fn rotation_of(matrix: Mat3, part: &Part<'_>) -> Result<Mat3, ClientError> {
    exact_rotation(&matrix)
        .ok_or_else(|| part.fault("NOT_A_ROTATION", "the camera's matrix is no rotation"))
}

/// Whether the cameras of a clip's frames are in different places.
pub(super) fn moves(cameras: &[ToWorld]) -> bool {
    let first = cameras.first();
    first.is_some_and(|first| cameras.iter().any(|camera| !camera.is_at(first)))
}

/// Gives every pose of `people` the camera of its frame, if the camera moves; whether it does. `part`
/// is where the cameras are from.
///
/// # Errors
/// When a pose's frame has no camera.
pub(super) fn follow(
    people: &mut [Person],
    cameras: &[ToWorld],
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
        seen.to_world = Some(*camera);
    }
    Ok(true)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::IDENTITY;

    fn at(x: f64) -> ToWorld {
        ToWorld {
            turn: rotation([0.3, -0.2, 0.1]),
            shift: [x, 1.0, -2.0],
        }
    }

    #[test]
    fn bodies_move_with_their_cameras() {
        let k = [[50.0, 0.0, 32.0], [0.0, 50.0, 48.0], [0.0, 0.0, 1.0]];
        let still = extrinsics(&IDENTITY, [0.0; 3]);
        let mut pose = [0.0; 72];
        pose[..3].copy_from_slice(&[0.1, 2.0, -0.4]);
        let placed = Placed {
            pose,
            root: [0.2, -0.1, 3.0],
        };
        let (camera, moved) = at(0.5).place(Camera { k, e: still }, placed);
        let e: Mat3 = std::array::from_fn(|i| std::array::from_fn(|j| camera.e[i][j]));
        let seen = add(
            apply(&e, moved.root),
            std::array::from_fn(|i| camera.e[i][3]),
        );
        let root = |pose: &[f64; 72]| rotation([pose[0], pose[1], pose[2]]);
        let turned = mul(&e, &root(&moved.pose));
        let wanted = root(&pose);
        let turns = turned.as_flattened().iter().zip(wanted.as_flattened());
        let off = seen.iter().zip(&placed.root).chain(turns);
        let mut off = off;
        assert!(off.all(|(a, b)| (a - b).abs() < 1e-12));
        assert!(at(0.5).is_at(&at(0.5005)) && !at(0.5).is_at(&at(0.51)));
    }
}
