//! Forward kinematics of a stance, with derivatives.

use crate::joints::{COLUMN, ROOT_POSITION};
use crate::markers::Marker;
use crate::parameters::{ATTACHMENTS, Shared, Stance};
use crate::rotation::{column, matmul, matvec};
use crate::skeleton::{COUNT, GROUP, chain, growing, offsets, parent};
use yoto_capture::skeleton::Vec3;
use yoto_capture::skeleton::transform::{Mat3, add, cross, scale, sub};

/// A stance's joints in the camera's axes.
#[derive(Clone, Debug)]
pub(crate) struct Posed {
    /// Rotations from the T-pose to the camera's axes.
    pub rotations: [Mat3; COUNT],
    /// Positions, metres.
    pub joints: [Vec3; COUNT],
    /// The derivative of each joint's offset from its parent by the logarithm of its group's length, metres.
    growth: [Vec3; COUNT],
}

/// The derivatives of a point by all unknowns in a table.
pub(crate) type Slopes = Vec<Vec3>;

impl Posed {
    /// The joints of `stance` on a body with `shared` bone lengths.
    pub(crate) fn new(stance: &Stance, shared: &Shared) -> Self {
        let factors = shared.factors();
        let offsets = offsets(&factors);
        let mut posed = Self {
            rotations: stance.rotations,
            joints: [stance.root; COUNT],
            growth: [[0.0; 3]; COUNT],
        };
        for joint in 1..COUNT {
            let above = parent(joint);
            let bone = matvec(&posed.rotations[above], offsets[joint]);
            posed.rotations[joint] = matmul(&posed.rotations[above], &stance.rotations[joint]);
            posed.joints[joint] = add(posed.joints[above], bone);
            if let Some(group) = GROUP[joint] {
                let growing = matvec(&posed.rotations[above], growing(joint));
                posed.growth[joint] = scale(growing, factors[group]);
            }
        }
        posed
    }

    /// The position of a marker.
    pub(crate) fn marker(&self, marker: &Marker, shared: &Shared) -> Vec3 {
        let [x, y, z] = shared.offset(marker.attachment);
        let offset = matvec(&self.rotations[marker.joint], [marker.side * x, y, z]);
        add(self.joints[marker.joint], offset)
    }

    /// The derivatives of a point `at` on `joint`: by the frame's unknowns, then by the shared ones if
    /// `width` includes them.
    pub(crate) fn slopes(&self, joint: usize, at: Vec3, frame: usize, width: usize) -> Slopes {
        let mut slopes = vec![[0.0; 3]; width];
        for above in chain(joint) {
            if let Some(first) = COLUMN[above] {
                let arm = sub(at, self.joints[above]);
                for axis in 0..3 {
                    slopes[first + axis] = cross(column(&self.rotations[above], axis), arm);
                }
            }
            if let Some(group) = GROUP[above]
                && width > frame
            {
                slopes[frame + group] = add(slopes[frame + group], self.growth[above]);
            }
        }
        for axis in 0..3 {
            slopes[ROOT_POSITION + axis][axis] = 1.0;
        }
        slopes
    }

    /// The derivatives that [`Posed::slopes`] gives for a joint, for a marker.
    pub(crate) fn marker_slopes(
        &self,
        marker: &Marker,
        at: Vec3,
        frame: usize,
        width: usize,
    ) -> Slopes {
        let mut slopes = self.slopes(marker.joint, at, frame, width);
        if width > frame {
            let first = frame + ATTACHMENTS + 3 * marker.attachment;
            let turned = &self.rotations[marker.joint];
            slopes[first] = column(turned, 0).map(|value| value * marker.side);
            slopes[first + 1] = column(turned, 1);
            slopes[first + 2] = column(turned, 2);
        }
        slopes
    }
}
