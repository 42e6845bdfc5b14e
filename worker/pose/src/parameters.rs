//! The unknowns of a fit: rotations and places of every frame, and what all frames share.

use crate::joints::{ACTIVE, PLACE};
use crate::markers::Markers;
use crate::rotation::matmul;
use crate::skeleton::{COUNT, GROUPS};
use yoto_capture::skeleton::Vec3;
use yoto_capture::skeleton::transform::{Mat3, add, rodrigues};

/// Shared unknowns besides bone lengths and the places of markers.
pub(crate) const FOCAL: usize = GROUPS;
/// How far the detector's space leans about the camera's x axis, radians.
pub(crate) const LEAN: usize = GROUPS + 1;
/// How far the camera looks down, radians.
pub(crate) const DOWN: usize = GROUPS + 2;
/// How far the camera is turned about its line of sight, radians.
pub(crate) const ROLL: usize = GROUPS + 3;
/// Where the markers' offsets begin, three a place.
pub(crate) const PLACES: usize = GROUPS + 4;

/// One frame's unknowns.
#[derive(Clone, Debug)]
pub(crate) struct Stance {
    /// Rotations of the 24 joints from their parents'; the root's from the camera's axes.
    pub rotations: [Mat3; COUNT],
    /// The root's place in the camera's axes, metres.
    pub root: Vec3,
}

/// What all frames share.
#[derive(Clone, Debug)]
pub(crate) struct Shared {
    /// `[GROUPS]` logarithms of bone lengths by the average's, the logarithm of the focal length,
    /// angles, then `[places, 3]` offsets of markers.
    pub values: Vec<f64>,
}

impl Shared {
    /// An average body and a focal length in pixels.
    pub fn average(markers: &Markers, focal: f64) -> Self {
        let mut values = vec![0.0; PLACES];
        values[FOCAL] = focal.ln();
        values.extend(markers.places.iter().flat_map(|place| place.offset));
        Self { values }
    }

    /// Factors of the groups' bone lengths.
    pub fn factors(&self) -> [f64; GROUPS] {
        std::array::from_fn(|group| self.values[group].exp())
    }

    /// Focal length, pixels.
    pub fn focal(&self) -> f64 {
        self.values[FOCAL].exp()
    }

    /// The offset of a place at the left, metres.
    pub fn offset(&self, place: usize) -> Vec3 {
        std::array::from_fn(|axis| self.values[PLACES + 3 * place + axis])
    }

    /// Moved by `step`.
    pub fn moved(&self, step: &[f64]) -> Self {
        let values = self.values.iter().zip(step).map(|(value, by)| value + by);
        Self {
            values: values.collect(),
        }
    }
}

impl Stance {
    /// Moved by `step`, `[UNKNOWNS]`: each rotation by a turn on its right.
    pub fn moved(&self, step: &[f64]) -> Self {
        let mut moved = self.clone();
        let three = |at: usize| -> Vec3 { std::array::from_fn(|i| step[at + i]) };
        for (at, &joint) in ACTIVE.iter().enumerate() {
            moved.rotations[joint] = matmul(&self.rotations[joint], &rodrigues(three(3 * at)));
        }
        moved.root = add(self.root, three(PLACE));
        moved
    }
}
