//! The motion of a tool's camera: from each frame's camera axes to a world that all frames share.
//!
//! Readings and their proof are of the camera's axes, in which the tools find bodies. Where the camera
//! moves, the body that was read is then moved to the world together with its camera, so that it
//! projects to the same pixels.

use crate::geometry::{
    Mat3, Vec3, add, extrinsics, log_map, matmul, matvec, rodrigues, scale, transpose,
};
use crate::track::{Camera, WorldPose};

/// Least change of an entry of the rotation, and of the position, metres, of a camera that moves.
const MOVED: [f64; 2] = [1e-4, 1e-3];

/// A camera's pose in the world: a point x in its axes is at `rotation x + position`, metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CameraPose {
    pub rotation: Mat3,
    pub position: Vec3,
}

impl CameraPose {
    /// A body in the camera's axes, and its camera, in the world.
    pub(crate) fn move_to_world(&self, camera: Camera, placed: WorldPose) -> (Camera, WorldPose) {
        let mut pose = placed.pose;
        let root = rodrigues([pose[0], pose[1], pose[2]]);
        pose[..3].copy_from_slice(&log_map(&matmul(&self.rotation, &root)));
        let placed = WorldPose {
            pose,
            root: add(matvec(&self.rotation, placed.root), self.position),
        };
        let back = transpose(&self.rotation);
        let e = extrinsics(&back, scale(matvec(&back, self.position), -1.0));
        (Camera { e, ..camera }, placed)
    }

    fn is_at(&self, other: &Self) -> bool {
        let far =
            |a: &[f64], b: &[f64], most: f64| a.iter().zip(b).any(|(a, b)| (a - b).abs() > most);
        let [rotated, moved] = MOVED;
        !far(
            self.rotation.as_flattened(),
            other.rotation.as_flattened(),
            rotated,
        ) && !far(&self.position, &other.position, moved)
    }
}

/// Whether the cameras of a clip's frames have different poses.
pub(crate) fn moves(cameras: &[CameraPose]) -> bool {
    let first = cameras.first();
    first.is_some_and(|first| cameras.iter().any(|camera| !camera.is_at(first)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::IDENTITY_ROTATION;

    fn at(x: f64) -> CameraPose {
        CameraPose {
            rotation: rodrigues([0.3, -0.2, 0.1]),
            position: [x, 1.0, -2.0],
        }
    }

    #[test]
    fn bodies_move_with_their_cameras() {
        let k = [[50.0, 0.0, 32.0], [0.0, 50.0, 48.0], [0.0, 0.0, 1.0]];
        let still = extrinsics(&IDENTITY_ROTATION, [0.0; 3]);
        let mut pose = [0.0; 72];
        pose[..3].copy_from_slice(&[0.1, 2.0, -0.4]);
        let placed = WorldPose {
            pose,
            root: [0.2, -0.1, 3.0],
        };
        let (camera, moved) = at(0.5).move_to_world(Camera { k, e: still }, placed);
        let e: Mat3 = std::array::from_fn(|i| std::array::from_fn(|j| camera.e[i][j]));
        let seen = add(
            matvec(&e, moved.root),
            std::array::from_fn(|i| camera.e[i][3]),
        );
        let root = |pose: &[f64; 72]| rodrigues([pose[0], pose[1], pose[2]]);
        let rotated = matmul(&e, &root(&moved.pose));
        let wanted = root(&pose);
        let entries = rotated.as_flattened().iter().zip(wanted.as_flattened());
        let off = seen.iter().zip(&placed.root).chain(entries);
        let mut off = off;
        assert!(off.all(|(a, b)| (a - b).abs() < 1e-12));
        assert!(at(0.5).is_at(&at(0.5005)) && !at(0.5).is_at(&at(0.51)));
    }
}
