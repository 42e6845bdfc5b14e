//! The unknowns of a fit: rotations and root position in every frame, and the unknowns that all frames share.

use crate::joints::{ACTIVE, ROOT_POSITION};
use crate::markers::Markers;
use crate::rotation::matmul;
use crate::skeleton::{COUNT, GROUPS};
use yoto_capture::skeleton::Vec3;
use yoto_capture::skeleton::transform::{Mat3, add, rodrigues};

/// Index of the focal length's logarithm, behind the bone lengths.
pub(crate) const FOCAL: usize = GROUPS;
/// Index of the lean of the detector's space about the camera's x axis, radians.
pub(crate) const LEAN: usize = GROUPS + 1;
/// Index of the camera's downward pitch, radians.
pub(crate) const DOWN: usize = GROUPS + 2;
/// Index of the camera's roll about its optical axis, radians.
pub(crate) const ROLL: usize = GROUPS + 3;
/// Index of the floor's height above the camera, metres.
pub(crate) const FLOOR: usize = GROUPS + 4;
/// Index of the first marker offset; three values per attachment.
pub(crate) const ATTACHMENTS: usize = GROUPS + 5;

/// One frame's unknowns.
#[derive(Clone, Debug)]
pub(crate) struct Stance {
    /// Rotations of the 24 joints relative to their parents; the root's is relative to the camera's axes.
    pub rotations: [Mat3; COUNT],
    /// Position of the root in the camera's axes, metres.
    pub root: Vec3,
}

/// The unknowns that all frames share.
#[derive(Clone, Debug)]
pub(crate) struct Shared {
    /// `[GROUPS]` logarithms of bone lengths relative to the average's, the logarithm of the focal length,
    /// angles, then `[attachments, 3]` offsets of markers.
    pub values: Vec<f64>,
}

impl Shared {
    /// The unknowns of an average body, with a focal length in pixels.
    pub(crate) fn average(markers: &Markers, focal: f64) -> Self {
        let mut values = vec![0.0; ATTACHMENTS];
        values[FOCAL] = focal.ln();
        values.extend(
            markers
                .attachments
                .iter()
                .flat_map(|attachment| attachment.offset),
        );
        Self { values }
    }

    /// Bone lengths of the groups relative to the average's.
    pub(crate) fn factors(&self) -> [f64; GROUPS] {
        std::array::from_fn(|group| self.values[group].exp())
    }

    /// Focal length, pixels.
    pub(crate) fn focal(&self) -> f64 {
        self.values[FOCAL].exp()
    }

    /// The offset of an attachment on the left side, metres.
    pub(crate) fn offset(&self, attachment: usize) -> Vec3 {
        std::array::from_fn(|axis| self.values[ATTACHMENTS + 3 * attachment + axis])
    }

    /// These unknowns after `step`.
    pub(crate) fn moved(&self, step: &[f64]) -> Self {
        let values = self.values.iter().zip(step).map(|(value, by)| value + by);
        Self {
            values: values.collect(),
        }
    }
}

impl Stance {
    /// This stance after `step`, `[UNKNOWNS]`: rotations change on their right, `R exp(δ)`.
    pub(crate) fn moved(&self, step: &[f64]) -> Self {
        let mut moved = self.clone();
        let three = |at: usize| -> Vec3 { std::array::from_fn(|i| step[at + i]) };
        for (at, &joint) in ACTIVE.iter().enumerate() {
            moved.rotations[joint] = matmul(&self.rotations[joint], &rodrigues(three(3 * at)));
        }
        moved.root = add(self.root, three(ROOT_POSITION));
        moved
    }
}
